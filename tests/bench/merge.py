#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Joins the parts of a benchmark run into one report and says which goals were met.

usage: merge.py BUILD OUT     reads OUT/part-*.json, writes OUT/speed.csv, appends to OUT/speed.txt
"""
import csv
import json
import pathlib
import platform
import subprocess
import sys

COLUMNS = ('section', 'name', 'format', 'width', 'height', 'ms', 'p99_ms', 'floor', 'floor_ms', 'ratio', 'limit', 'met')


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


def write_csv(path, rows):
    """One line per figure; a goal that was not set leaves `limit` and `met` empty."""
    with open(path, 'w', newline='') as table:
        writer = csv.writer(table, lineterminator='\n')
        writer.writerow(COLUMNS)
        for row in rows:
            has_goal = bool(row['limit'])
            writer.writerow([row[name] if has_goal or name not in ('limit', 'met') else '' for name in COLUMNS])


def main():
    build, out = sys.argv[1], pathlib.Path(sys.argv[2])
    rows = []
    for part in sorted(out.glob('part-*.json')):
        rows += json.loads(part.read_text())
        part.unlink()
    write_csv(out / 'speed.csv', rows)
    load = pathlib.Path('/proc/loadavg').read_text().split()[:3]
    goals = [row for row in rows if row['limit']]
    missed = [row for row in goals if not row['met']]
    lines = ['', f'processor {processor()}, {platform.platform()}',
             f'compiler {compiler(build)}, commit {text_of(["git", "rev-parse", "--short", "HEAD"])}, load {" ".join(load)}',
             f'{len(goals) - len(missed)} of {len(goals)} goals met']
    lines += [f'missed: {row["name"]}, {row["format"]} {row["width"]}x{row["height"]}: {row["ratio"]:.3f}, '
              f'goal {row["limit"]:g}' for row in missed]
    print('\n'.join(lines))
    with open(out / 'speed.txt', 'a') as report:
        report.write('\n'.join(lines) + '\n')


if __name__ == '__main__':
    main()
