#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Whole frames of this build against those of another version, in turn on one processor.

usage: paired.py OTHER_SOURCE OTHER_BUILD [--build BUILD] [--motion [--both]] [--rounds N] [--megabytes N]
  OTHER_SOURCE is a checkout of the other version, OTHER_BUILD an optimised build of it (so is BUILD, default
  build-release); tests/bench/frame_time.cpp is compiled against both. --motion: motion=auto in this version alone;
  with --both in the other version, too.
Both programs render the same frames and let them rotate, N megabytes of them each; each processes eight, then the other
does. Told is the mean time of a frame of each and the ratio, of the fastest eight frames, of the fastest tenth and of the
median: not every frame has its share of each stage, and on a machine where other programs run the fastest ones mean most.
"""
import argparse
import os
import pathlib
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
BENCH = ROOT / 'tests' / 'bench'
# Name, width, height, mask level, threads.
ROWS = [('480p', 854, 480, 0, 1), ('1080p', 1920, 1080, 0, 1), ('1080p, mask-level=2', 1920, 1080, 2, 1), ('4K', 3840, 2160, 0, 1),
        ('4K, mask-level=2', 3840, 2160, 2, 1), ('1080p, n-threads=2', 1920, 1080, 0, 2), ('4K, n-threads=2', 3840, 2160, 0, 2)]
FRAMES = 8
WARM_UP = 20
ASLEEP = 0.002  # seconds, after which the threads of the other program, which wait for a next frame, no longer spin


def compiled(source, build, out):
    """frame_time against the public face and the libraries of a version."""
    libraries = [build / 'src' / 'scene' / 'libterrainseg_scene.a', build / 'src' / 'libterrainseg_core.a']
    for library in libraries:
        if not library.exists():
            sys.exit(f'{library} is missing: build it (ninja -C {build})')
    subprocess.run([os.environ.get('CXX', 'c++'), '-std=c++20', '-O2', f'-I{source}/include', f'-I{source}/src', f'-I{BENCH}',
                    BENCH / 'frame_time.cpp', BENCH / 'frame_set.cpp', *libraries, '-lhwy', '-lpthread', '-o', out], check=True)
    return out


class Side:
    """A program that waits, and the times it told."""

    def __init__(self, program, row, motion, options):
        _, width, height, level, threads = row
        words = [program, width, height, level, threads, int(motion), options.megabytes]
        processors = sorted(os.sched_getaffinity(0))[-threads:]
        self.process = subprocess.Popen([str(word) for word in words], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
                                        preexec_fn=lambda: os.sched_setaffinity(0, processors))
        self.process.stdout.readline()
        self.run(WARM_UP)
        self.times = []

    def run(self, count):
        self.process.stdin.write(f'{count}\n')
        self.process.stdin.flush()
        return [int(word) for word in self.process.stdout.readline().split()]

    def measure(self):
        time.sleep(ASLEEP)
        self.times.append(sum(self.run(FRAMES)) / FRAMES)

    def end(self):
        self.process.stdin.close()
        self.process.wait()
        self.times.sort()

    def milliseconds(self, share):
        return self.times[int(share * (len(self.times) - 1))] / 1e6


def compare(programs, row, options):
    other, ours = Side(programs[0], row, options.motion and options.both, options), Side(programs[1], row, options.motion, options)
    for turn in range(options.rounds):
        for side in (other, ours)[::1 if turn % 2 else -1]:
            side.measure()
    other.end()
    ours.end()
    figures = [f'{ours.milliseconds(share):.3f} / {other.milliseconds(share):.3f} = '
               f'{ours.milliseconds(share) / other.milliseconds(share):.3f}' for share in (0, 0.1, 0.5)]
    print(f'{row[0]:22}' + ''.join(f'{figure:>26}' for figure in figures), flush=True)


def main():
    parser = argparse.ArgumentParser(usage=__doc__, add_help=False)
    parser.add_argument('source', type=pathlib.Path)
    parser.add_argument('other_build', type=pathlib.Path)
    parser.add_argument('--build', type=pathlib.Path, default=ROOT / 'build-release')
    parser.add_argument('--motion', action='store_true')
    parser.add_argument('--both', action='store_true')
    parser.add_argument('--rounds', type=int, default=100)
    parser.add_argument('--megabytes', type=int, default=600)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        programs = [compiled(options.source, options.other_build, pathlib.Path(folder) / 'other'),
                    compiled(ROOT, options.build, pathlib.Path(folder) / 'ours')]
        print(f'ms a frame, ours / other; load {pathlib.Path("/proc/loadavg").read_text().split()[0]}')
        print(f'{"":22}{"fastest":>26}{"fastest tenth":>26}{"median":>26}')
        for row in ROWS:
            compare(programs, row, options)


if __name__ == '__main__':
    main()
