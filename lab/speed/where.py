#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Where a frame's instructions, cache misses and time go.

usage: where.py SOURCE BUILD [--sizes 854x480,1280x720,1920x1080,3840x2160] [--frames N] [--levels 0]
  SOURCE is a checkout, BUILD an optimised build of it; where.cpp is compiled against both. Instructions and misses of the
  first (D1) and the last (LL) simulated cache are valgrind's, thousands a frame, of a function and what it calls. Times are
  microseconds of the stages in the fastest tenth of the frames, frames from memory.
"""
import argparse
import os
import pathlib
import re
import subprocess
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
FUNCTIONS = ['Segmenter::process', 'Pyramid::build', 'FrameReader::read_cells', 'WindowTeacher::learn', 'TerrainTables::of',
             'CellScorer::score', 'UprightCoherence::look', 'GroundTracer::trace', 'Reestimation::revise', 'RefinedCurves::refine',
             'OddSpots::find', 'StoneField::find', 'StandingThings::find', 'AnswerWriter::write', 'FreeSpace::write']


def compiled(source, build, out):
    libraries = [build / 'src' / 'scene' / 'libterrainseg_scene.a', build / 'src' / 'libterrainseg_core.a']
    subprocess.run([os.environ.get('CXX', 'c++'), '-std=c++20', '-O2', '-g', f'-I{source}/include', f'-I{source}/src',
                    HERE / 'where.cpp', *libraries, '-lhwy', '-lpthread', '-o', out], check=True)


def counts(program, drive, width, height, level, motion, frames, folder):
    """Thousands a frame of each function: instructions, D1 misses, LL misses."""
    out = folder / 'callgrind.out'
    subprocess.run(['valgrind', '--tool=callgrind', '--cache-sim=yes', f'--callgrind-out-file={out}',
                    '--toggle-collect=terrainseg::Segmenter::process*', program, 'run', drive, str(width), str(height),
                    str(level), '1', str(motion), str(frames)], check=True, capture_output=True)
    text = subprocess.run(['callgrind_annotate', '--inclusive=yes', '--threshold=100', '--show=Ir,D1mr,D1mw,DLmr,DLmw', out],
                          check=True, capture_output=True, text=True).stdout
    found = {}
    for line in text.splitlines():
        numbers = [int(word.replace(',', '')) for word in re.findall(r'([\d,]+) \(', line)]
        for function in FUNCTIONS:
            if len(numbers) == 5 and f'terrainseg::{function}(' in line and function not in found:
                ir, d1r, d1w, llr, llw = numbers
                found[function] = [count / frames / 1000 for count in (ir, d1r + d1w, llr + llw)]
    return found


def main():
    parser = argparse.ArgumentParser(usage=__doc__, add_help=False)
    parser.add_argument('source', type=pathlib.Path)
    parser.add_argument('build', type=pathlib.Path)
    parser.add_argument('--sizes', default='854x480,1280x720,1920x1080,3840x2160')
    parser.add_argument('--levels', default='0', help='mask levels')
    parser.add_argument('--frames', type=int, default=46)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        program, drive = folder / 'where', folder / 'drive.yuv'
        compiled(options.source, options.build, program)
        for size in options.sizes.split(','):
            width, height = map(int, size.split('x'))
            subprocess.run([program, 'render', drive, str(width), str(height), '24'], check=True)
            for level in options.levels.split(','):
                for motion in (0, 1):
                    told = subprocess.run([program, 'run', drive, str(width), str(height), level, '1', str(motion), '400', '300'],
                                          check=True, capture_output=True, text=True).stdout.splitlines()
                    print(f'\n{size}, mask-level={level}, motion {"on" if motion else "off"}: {told[0]}')
                    print('us: ' + ', '.join(told[1:]))
                    print(f'{"thousands a frame":38}{"Ir":>9}{"D1":>8}{"LL":>8}')
                    for function, row in counts(program, drive, width, height, level, motion, options.frames, folder).items():
                        print(f'{function:38}{row[0]:9.0f}{row[1]:8.2f}{row[2]:8.2f}', flush=True)


if __name__ == '__main__':
    main()
