#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Instructions of a frame on AArch64 with NEON beside x86-64 with SSE4, by source file of the kernels.

usage: arm.py [FOLDER] [--sizes 854x480,1920x1080] [--frames N]
  FOLDER is that of tests/ci/aarch64.sh (default: build-aarch64), which runs first: it fetches the compiler, qemu-user and
  Highway for AArch64. Both programs are compiled here from the same sources with the same options, and qemu-user counts
  both: a Cortex-A72 (the Raspberry Pi 4: NEON, no SVE) and a Westmere (SSE4.2, no AVX). Thousands of instructions a frame,
  the mean of N frames after the first N.
"""
import argparse
import collections
import os
import pathlib
import subprocess
import sys
import tempfile

TOP = pathlib.Path(__file__).resolve().parent.parent.parent
LEFT_OUT = ('tools', 'metric', 'recording', 'ros2')  # as tests/ci/aarch64.sh does
REST = 'outside the kernels'


def run(*words, **more):
    return subprocess.run([str(word) for word in words], check=True, text=True, **more)


def built(out, compiler, flags, link):
    """The program, and the row of each symbol: the source file of a kernel, or the rest. Of where.cpp none is counted."""
    out.mkdir(exist_ok=True)
    sources = [source for source in sorted((TOP / 'src').rglob('*.cpp')) if source.relative_to(TOP / 'src').parts[0] not in LEFT_OUT]
    sources.append(TOP / 'lab' / 'speed' / 'where.cpp')
    objects = {out / (str(source.relative_to(TOP)).replace('/', '_') + '.o'): source for source in sources}
    rules = ''.join(f'{at}: {source}\n\t{compiler} {flags} -MMD -c $< -o $@\n' for at, source in objects.items())
    (out / 'Makefile').write_text(f'all: {" ".join(map(str, objects))}\n{rules}-include {out}/*.d\n')
    run('make', '-s', f'-j{os.cpu_count()}', '-f', out / 'Makefile', 'all')
    program = out / 'where'
    run(compiler, '-pthread', '-o', program, *objects, *link, '-lhwy')
    files = {}
    for at, source in objects.items():
        if source.name != 'where.cpp':
            row = source.stem if source.parent.name == 'kernels' else REST
            for line in run('nm', '--defined-only', at, capture_output=True).stdout.splitlines():
                files.setdefault(line.split()[-1], row)
    return program, files


def counted(emulator, plugin, program, files, drive, size, motion, frames, folder):
    """Instructions by row."""
    out = folder / 'counts'
    width, height = size.split('x')
    run(*emulator, '-plugin', f'{plugin},out={out}', program, 'run', drive, width, height, 0, 1, motion, frames, capture_output=True)
    found = collections.Counter()
    for line in out.read_text().splitlines():
        count, symbol = line.split(None, 1)
        if symbol in files:
            found[files[symbol]] += int(count)
    return found


def main():
    parser = argparse.ArgumentParser(usage=__doc__, add_help=False)
    parser.add_argument('folder', type=pathlib.Path, nargs='?', default=pathlib.Path('build-aarch64'))
    parser.add_argument('--sizes', default='854x480,1920x1080')
    parser.add_argument('--frames', type=int, default=20)
    options = parser.parse_args()
    folder = options.folder.resolve()
    root = folder / 'root' / 'usr'
    if not root.is_dir():
        sys.exit(f'{folder} lacks Highway for AArch64: run tests/ci/aarch64.sh first')
    flags = f'-std=c++20 -O3 -I{TOP}/include -I{TOP}/src -pthread'
    with tempfile.TemporaryDirectory() as name:
        scratch = pathlib.Path(name)
        plugin, drive = scratch / 'count.so', scratch / 'drive.yuv'
        run('cc', '-O2', '-shared', '-fPIC', TOP / 'lab' / 'speed' / 'count.c', '-o', plugin)
        x86, x86_files = built(folder / 'counted-x86', 'g++', flags, [])
        arm, arm_files = built(folder / 'counted-arm', 'aarch64-linux-gnu-g++', f'{flags} -isystem {folder}/include',
                               [f'-L{root}/lib/aarch64-linux-gnu'])
        emulators = (['qemu-x86_64', '-cpu', 'Westmere'],
                     ['qemu-aarch64', '-cpu', 'cortex-a72', '-L', '/usr/aarch64-linux-gnu',
                      '-E', f'LD_LIBRARY_PATH={root}/lib/aarch64-linux-gnu'])
        for size in options.sizes.split(','):
            run(x86, 'render', drive, *size.split('x'), 12)
            for motion in 0, 1:
                columns = []
                for emulator, program, files in zip(emulators, (x86, arm), (x86_files, arm_files)):
                    first, both = (counted(emulator, plugin, program, files, drive, size, motion, count, scratch)
                                   for count in (options.frames, 2 * options.frames))
                    columns.append({row: (both[row] - first[row]) / options.frames / 1000 for row in both})
                for column in columns:
                    column['frame'] = sum(column.values())
                print(f'{size}, motion {"on" if motion else "off"}: thousands of instructions a frame\n')
                print('| source of the kernels | SSE4 | NEON | NEON / SSE4 |\n|---|---|---|---|')
                for row in sorted(columns[0], key=lambda row: columns[0][row]):
                    sse, neon = columns[0][row], columns[1].get(row, 0)
                    if sse >= 0.5:
                        print(f'| {row} | {sse:.0f} | {neon:.0f} | {neon / sse:.2f} |')
                print(flush=True)


if __name__ == '__main__':
    main()
