#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Prints "PASSED FAILED" for the last `meson test` of a build folder.

usage: count_results.py BUILD/meson-logs

Every case of a GoogleTest program counts, every script counts once. A program that crashed, timed out or left no
report counts as failed even when its report (or an older one) shows no failure.
"""
import json
import sys
import xml.etree.ElementTree as ElementTree


def main():
    logs = sys.argv[1]
    programs = [json.loads(line) for line in open(f'{logs}/testlog.json')]
    cases = {program['name']: [0, 0] for program in programs}
    for suite in ElementTree.parse(f'{logs}/testlog.junit.xml').getroot().iter('testsuite'):
        # A GoogleTest suite is named PROJECT.PROGRAM.SUITE, a script that reports its cases PROJECT.PROGRAM; another
        # script is itself a case of the suite PROJECT.
        _, _, rest = suite.get('name').partition('.')
        for case in suite.findall('testcase'):
            program = next((n for n in cases if f'{rest}.'.startswith(n + '.')), None) if rest else case.get('name')
            bad = case.find('failure') is not None or case.find('error') is not None
            skipped = case.find('skipped') is not None or case.get('status') == 'notrun'
            if program not in cases:
                sys.exit(f'{logs}: {suite.get("name")} belongs to no program of this run')
            cases[program][bad] += not skipped
    passed = failed = 0
    for program in programs:
        good, bad = cases[program['name']]
        if program['result'] not in ('OK', 'SKIP', 'EXPECTEDFAIL'):
            bad = max(bad, 1)
            print(f"{program['result']}: {program['name']}", file=sys.stderr)
        passed, failed = passed + good, failed + bad
    if not programs:
        sys.exit(f'{logs}: no test was run')
    print(passed, failed)


if __name__ == '__main__':
    main()
