#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Puts the tables that terrainseg-eval measured into the text of a report.

usage: fill_report.py TEXT REPORT TABLES [TABLES...]

A line `<!-- insert NAME -->` of TEXT becomes the section NAME of the first TABLES, `FILE/NAME` that of FILE.md among the others; `@COMMIT@`, `@PROCESSOR@` and `@COMPILER@` are
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
    if len(sys.argv) < 4:
        sys.exit(__doc__)
    text, report, *tables = map(pathlib.Path, sys.argv[1:])
    found = sections(tables[0].read_text())
    for more in tables[1:]:
        found |= {f'{more.stem}/{name}': body for name, body in sections(more.read_text()).items()}
    out = ['<!-- Written by lab/evaluation/accuracy.sh from accuracy.in.md: change that one. -->']
    for line in text.read_text().splitlines():
        out.append(line)
        wanted = re.fullmatch(r'<!-- insert (\S+) -->', line)
        if wanted:
            if wanted[1] not in found:
                sys.exit(f'fill_report: no section {wanted[1]} in {", ".join(map(str, tables))}')
            out[-1] = found[wanted[1]]
    whole = '\n'.join(out) + '\n'
    whole = whole.replace('@COMMIT@', run('git', '-C', str(text.parent), 'rev-parse', '--short', 'HEAD'))
    whole = whole.replace('@PROCESSOR@', processor())
    whole = whole.replace('@COMPILER@', run('c++', '--version').split('\n')[0])
    report.write_text(whole)


if __name__ == '__main__':
    main()
