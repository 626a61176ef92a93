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
    cases = {}
    for suite in ElementTree.parse(f'{logs}/testlog.junit.xml').getroot().iter('testsuite'):
        for case in suite.findall('testcase'):
            bad = case.find('failure') is not None or case.find('error') is not None
            skipped = case.find('skipped') is not None or case.get('status') == 'notrun'
            name = suite.get('name').split('.')[1] if '.' in suite.get('name') else case.get('name')
            passed, failed = cases.get(name, (0, 0))
            cases[name] = (passed + (not bad and not skipped), failed + bad)
    passed = failed = 0
    for program in programs:
        name = program['name'].split(' / ')[-1].split(':')[-1]
        good, bad = cases.get(name, (0, 0))
        if program['result'] not in ('OK', 'SKIP', 'EXPECTEDFAIL'):
            bad = max(bad, 1)
            print(f"{program['result']}: {program['name']}", file=sys.stderr)
        passed, failed = passed + good, failed + bad
    if not programs:
        sys.exit(f'{logs}: no test was run')
    print(passed, failed)


if __name__ == '__main__':
    main()
