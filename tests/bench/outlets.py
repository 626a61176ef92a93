#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Times the ways out and back for a 1080p frame with a mask value for every pixel, as rows of the benchmark's report.

usage: outlets.py PROGRAM OUT.json [--quick]     PROGRAM: outlet_elements_bench

The goal is a time, not a ratio: 0.3 ms of processor time a frame for KLV, for JSON lines and for the way back. The
floor of these rows is one millisecond.
"""
import json
import subprocess
import sys

GOAL = 0.3
NAMES = {'Extract/lines': 'terrainextract, JSON line', 'Extract/klv': 'terrainextract, KLV unit',
         'Combine/process_time': 'terraincombine, KLV unit'}


def main():
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    seconds = 0.2 if '--quick' in sys.argv else 2
    report = json.loads(subprocess.run(
        [sys.argv[1], f'--benchmark_filter=^({"|".join(NAMES)})$', f'--benchmark_min_time={seconds}',
         '--benchmark_repetitions=9', '--benchmark_format=json'], check=True, stdout=subprocess.PIPE).stdout)
    times = {}
    for run in report['benchmarks']:
        if run['run_type'] == 'iteration':
            assert run['time_unit'] == 'us'
            times.setdefault(run['run_name'], []).append(run['cpu_time'] / 1000)
    if set(times) != set(NAMES):
        sys.exit(f'outlets.py: {sys.argv[1]} measured {sorted(times)}')
    rows = []
    print(f'\n{"outlets":<58} {"format":<6} {"size":<10} {"ms":>9}  goal')
    for run, name in NAMES.items():
        taken = sorted(times[run])
        median, most = taken[len(taken) // 2], taken[-1]
        rows.append({'section': 'outlets', 'name': name, 'format': 'I420', 'width': 1920, 'height': 1080, 'ms': median,
                     'p99_ms': most, 'floor': 'one millisecond', 'floor_ms': 1.0, 'ratio': median, 'limit': GOAL,
                     'met': median <= GOAL})
        print(f'{name:<58} {"I420":<6} {"1920x1080":<10} {median:9.4f}  <= {GOAL} ms {"met" if median <= GOAL else "MISSED"}')
    with open(sys.argv[2], 'w') as out:
        json.dump(rows, out, indent=1)


if __name__ == '__main__':
    main()
