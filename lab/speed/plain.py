#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""What the vectors of each kernel file save: a frame with that file as plain loops, as a ratio to the frame with all vectors.

usage: plain.py BUILD [--sizes 854x480,1920x1080,3840x2160] [--rounds 7] [--frames 240] [--kind 0]
  BUILD is an optimised build of this checkout. Plain: the file compiled for Highway's scalar target, so that its loops are the
  compiler's for the oldest processor of the architecture. Times are the mean of the frames without the slowest tenth, frames
  from memory; each round runs all programs in turn, and the least of the rounds counts. KIND is that of `where render`.
"""
import argparse
import json
import os
import pathlib
import shlex
import subprocess
import tempfile

TOP = pathlib.Path(__file__).resolve().parent.parent.parent


def compiled(command, folder, out):
    """The object of a kernel file, compiled as in the build but for the scalar target."""
    words = [word for word in shlex.split(command['command']) if word != 'ccache']
    for option in ('-o', '-MF', '-MQ'):
        at = words.index(option)
        del words[at:at + 2]
    subprocess.run([*words, '-DHWY_COMPILE_ONLY_SCALAR', '-o', out], cwd=folder, check=True)


def main():
    parser = argparse.ArgumentParser(usage=__doc__, add_help=False)
    parser.add_argument('build', type=pathlib.Path)
    parser.add_argument('--sizes', default='854x480,1920x1080,3840x2160')
    parser.add_argument('--rounds', type=int, default=7)
    parser.add_argument('--frames', type=int, default=240)
    parser.add_argument('--kind', default='0')
    options = parser.parse_args()
    build = options.build.resolve()
    libraries = [build / 'src' / 'scene' / 'libterrainseg_scene.a', build / 'src' / 'libterrainseg_core.a', '-lhwy', '-lpthread']
    commands = {pathlib.Path(entry['file']).stem: entry for entry in json.loads((build / 'compile_commands.json').read_text())
                if '/src/kernels/' in entry['file'].replace('../src', '/src') and 'libterrainseg_core.a.p' in entry['command']}
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        main_object, drive = folder / 'where.o', folder / 'drive.yuv'
        subprocess.run([os.environ.get('CXX', 'c++'), '-std=c++20', '-O2', f'-I{TOP}/include', f'-I{TOP}/src', '-c',
                        TOP / 'lab' / 'speed' / 'where.cpp', '-o', main_object], check=True)
        programs = {}
        for kernel in ['', *sorted(commands)]:
            objects = []
            if kernel:
                objects = [folder / f'{kernel}.o']
                compiled(commands[kernel], build, objects[0])
            programs[kernel] = folder / f'where-{kernel or "all"}'
            subprocess.run([os.environ.get('CXX', 'c++'), main_object, *objects, *libraries, '-o', programs[kernel]], check=True)
        print('| size, motion | all vectors, us |', ' | '.join(kernel for kernel in programs if kernel), '|')
        print('|---' * (len(programs) + 1) + '|')
        for size in options.sizes.split(','):
            width, height = size.split('x')
            subprocess.run([programs[''], 'render', drive, width, height, '12', options.kind], check=True)
            for motion in '0', '1':
                times, digests = {kernel: [] for kernel in programs}, set()
                for _ in range(options.rounds):
                    for kernel, program in programs.items():
                        said = subprocess.run([program, 'run', drive, width, height, '0', '1', motion, str(options.frames), '200'], check=True,
                                              capture_output=True, text=True).stdout
                        values = dict(line.split() for line in said.splitlines())
                        digests.add(values['digest'])
                        times[kernel].append(float(values['most']))
                assert len(digests) == 1, 'plain loops and vectors differ'
                fastest = {kernel: min(of) for kernel, of in times.items()}
                print(f'| {size}, {"on" if motion == "1" else "off"} | {fastest[""]:.0f} |',
                      ' | '.join(f'{fastest[kernel] / fastest[""]:.2f}' for kernel in programs if kernel), '|', flush=True)


if __name__ == '__main__':
    main()
