#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Puts the tables that terrainseg-eval measured into the text of a report.

usage: fill_report.py TEXT TABLES REPORT

A line `<!-- insert NAME -->` of TEXT is followed by the section NAME of TABLES; `@COMMIT@`, `@PROCESSOR@` and `@COMPILER@` are
replaced by what was measured with.
"""
import pathlib
import platform
import re
import subprocess
import sys


def sections(text):
    parts = re.split(r'^<!-- section (\S+) -->$', text, flags=re.M)
    return {name: body.strip() for name, body in zip(parts[1::2], parts[2::2])}


def processor():
    for line in pathlib.Path('/proc/cpuinfo').read_text().splitlines():
        if line.startswith('model name'):
            return line.split(':', 1)[1].strip()
    return platform.machine()


def run(*command):
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return 'unknown'


def main():
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    text, tables, report = map(pathlib.Path, sys.argv[1:])
    found = sections(tables.read_text())
    out = ['<!-- Written by tests/evaluation/accuracy.sh from accuracy.in.md: change that one. -->']
    for line in text.read_text().splitlines():
        out.append(line)
        wanted = re.fullmatch(r'<!-- insert (\S+) -->', line)
        if wanted:
            if wanted[1] not in found:
                sys.exit(f'fill_report: {tables} has no section {wanted[1]}')
            out[-1] = found[wanted[1]]
    whole = '\n'.join(out) + '\n'
    whole = whole.replace('@COMMIT@', run('git', '-C', str(text.parent), 'rev-parse', '--short', 'HEAD'))
    whole = whole.replace('@PROCESSOR@', processor())
    whole = whole.replace('@COMPILER@', run('c++', '--version').split('\n')[0])
    report.write_text(whole)


if __name__ == '__main__':
    main()
