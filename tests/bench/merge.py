#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Joins the parts of a benchmark run into one report and says which goals were met.

usage: merge.py BUILD OUT     reads OUT/part-*.json, writes OUT/report.json, appends to OUT/report.txt
"""
import json
import pathlib
import platform
import subprocess
import sys


def text_of(command):
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return 'unknown'


def processor():
    names = [line.split(':', 1)[1].strip() for line in pathlib.Path('/proc/cpuinfo').read_text().splitlines()
             if line.lower().startswith(('model name', 'cpu model'))]
    return f'{names[0] if names else platform.machine()} ({len(names)} processors)'


def compiler(build):
    start = 'C++ compiler for the host machine:'
    for line in (pathlib.Path(build) / 'meson-logs' / 'meson-log.txt').read_text().splitlines():
        if line.startswith(start):
            return line[len(start):].strip()
    return 'unknown'


def main():
    build, out = sys.argv[1], pathlib.Path(sys.argv[2])
    rows = []
    for part in sorted(out.glob('part-*.json')):
        rows += json.loads(part.read_text())
        part.unlink()
    report = {'processor': processor(), 'system': platform.platform(), 'compiler': compiler(build),
              'commit': text_of(['git', 'rev-parse', '--short', 'HEAD']),
              'load': pathlib.Path('/proc/loadavg').read_text().split()[:3], 'rows': rows}
    (out / 'report.json').write_text(json.dumps(report, indent=1) + '\n')
    goals = [row for row in rows if row['limit']]
    missed = [row for row in goals if not row['met']]
    lines = ['', f'processor {report["processor"]}', f'compiler {report["compiler"]}, commit {report["commit"]}, '
             f'load {" ".join(report["load"])}', f'{len(goals) - len(missed)} of {len(goals)} goals met']
    lines += [f'missed: {row["name"]}, {row["format"]} {row["width"]}x{row["height"]}: {row["ratio"]:.3f}, '
              f'goal {row["limit"]:g}' for row in missed]
    print('\n'.join(lines))
    with open(out / 'report.txt', 'a') as report_text:
        report_text.write('\n'.join(lines) + '\n')


if __name__ == '__main__':
    main()
