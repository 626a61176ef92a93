#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Fails when a kernel's ratio to its floor has doubled against the committed figures.

Ratios to a memcpy in the same loop, not times; the best of several runs, because noise only ever adds. Figures of the
targets that this machine lacks are not looked at. Another processor or another C library has another memcpy (with the one of
Debian 13 the mask's ratio is 2.8 times that of Debian 12): there only a loss of the factor WORSE_ELSEWHERE fails. What the plain loops (SCALAR) become is the compiler's affair: they fail from
WORSE_PLAIN on, which is less than vectors gain them.

usage: check_figures.py BENCH FIGURES [--record]     BENCH: terrainseg-bench; --record replaces FIGURES
"""
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile

TARGETS = ('AVX3', 'AVX2', 'SSE4', 'NEON', 'SCALAR')
WORSE = 2.0
WORSE_ELSEWHERE = 6.0
WORSE_PLAIN = 3.0
RUNS = 4


def this_machine():
    model = re.search(r'^model name\s*: (.*)$', pathlib.Path('/proc/cpuinfo').read_text(), re.M)
    return {'processor': model.group(1) if model else os.uname().machine, 'c library': os.confstr('CS_GNU_LIBC_VERSION')}


def measured(bench, target):
    """Name of the kernel to ratio; None when the machine does not have the target."""
    with tempfile.NamedTemporaryFile(suffix='.json') as out:
        command = [bench, '--quick', '--target', target, '--json', out.name, 'kernels']
        if subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL).returncode:
            return None
        rows = json.loads(pathlib.Path(out.name).read_text())
    return {row['name']: row['ratio'] for row in rows}


def best_of_runs(bench, target, good_enough):
    best = measured(bench, target)
    for _ in range(RUNS - 1):
        if best is None or good_enough(best):
            break
        again = measured(bench, target)
        best = {name: min(ratio, again[name]) for name, ratio in best.items()}
    return best


def record(bench, path):
    figures = {target: best_of_runs(bench, target, lambda best: False) for target in TARGETS}
    figures = {target: {name: round(ratio, 2) for name, ratio in rows.items()}
               for target, rows in figures.items() if rows}
    path.write_text(json.dumps({'recorded on': this_machine(), **figures}, indent=2) + '\n')


def main():
    bench, path = sys.argv[1], pathlib.Path(sys.argv[2])
    if '--record' in sys.argv[3:]:
        return record(bench, path)
    figures = json.loads(path.read_text())
    worse = WORSE if figures.pop('recorded on') == this_machine() else WORSE_ELSEWHERE
    bad = looked_at = 0
    for target, committed in figures.items():
        limit = max(worse, WORSE_PLAIN) if target == 'SCALAR' else worse
        now = best_of_runs(bench, target,
                           lambda best: all(best.get(n, 1e9) <= limit * r for n, r in committed.items()))
        if now is None:
            print(f'{target}: not of this machine')
            continue
        for name, ratio in committed.items():
            looked_at += 1
            if name not in now:
                bad += 1
                print(f'{target}: {name}: no longer measured')
            elif now[name] > limit * ratio:
                bad += 1
                print(f'{target}: {name}: {now[name]:.2f} memcpys, committed {ratio:.2f}')
    print(f'{looked_at} figures looked at, {bad} much worse than the committed one')
    if looked_at == 0:
        sys.exit(77)  # none of the recorded targets: skipped
    sys.exit(1 if bad else 0)


if __name__ == '__main__':
    main()
