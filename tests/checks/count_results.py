#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Prints "PASSED FAILED" for the last `meson test` of a build folder, and on stderr what failed, one "FAILED: ..." a line.

usage: count_results.py BUILD/meson-logs
       count_results.py --real-time BUILD/meson-logs     names what failed and measures real time, one a line

Every case of a GoogleTest program counts, every script counts once. A program that crashed, timed out or left no
report counts as failed even when its report (or an older one) shows no failure. What was tried again, alone
(`meson test --logbase again`), counts as that second try says.
"""
import json
import os
import sys
import xml.etree.ElementTree as ElementTree


# What these suites test has threads, networks and clocks in it; "unit" and "golden" have none and get no second try.
REAL_TIME = {'element', 'pipeline', 'tools', 'docs'}
GOOD = 'OK', 'SKIP', 'EXPECTEDFAIL'


def read(logs, base):
    """The programs of a run: result, how many cases passed, and the names of those that failed."""
    programs = [json.loads(line) for line in open(f'{logs}/{base}.json')]
    passed = {program['name']: 0 for program in programs}
    failed = {program['name']: [] for program in programs}
    for suite in ElementTree.parse(f'{logs}/{base}.junit.xml').getroot().iter('testsuite'):
        # A GoogleTest suite is named PROJECT.PROGRAM.SUITE, a script that reports its cases PROJECT.PROGRAM; another
        # script is itself a case of the suite PROJECT.
        _, _, rest = suite.get('name').partition('.')
        for case in suite.findall('testcase'):
            program = next((n for n in passed if f'{rest}.'.startswith(n + '.')), None) if rest else case.get('name')
            bad = case.find('failure') is not None or case.find('error') is not None
            skipped = case.find('skipped') is not None or case.get('status') == 'notrun'
            if program not in passed:
                sys.exit(f'{logs}: {suite.get("name")} belongs to no program of this run')
            if bad:
                failed[program].append(case.get('name'))
            elif not skipped:
                passed[program] += 1
    return {p['name']: (p['result'], passed[p['name']], failed[p['name']]) for p in programs}


def main():
    *options, logs = sys.argv[1:]
    programs = read(logs, 'testlog')
    if not programs:
        sys.exit(f'{logs}: no test was run')
    if options == ['--real-time']:
        for name, (result, _, _) in programs.items():
            suite, _, test = name.rpartition(' / ')
            if result not in GOOD and REAL_TIME & set(suite.partition(':')[2].split('+')):
                print(test)
        return
    if os.path.exists(f'{logs}/again.json'):
        programs.update(read(logs, 'again'))
    passed = failed = 0
    for name, (result, good, bad) in programs.items():
        if result not in GOOD and not bad:
            bad = [f'no case failed, but {result}']
        for case in bad:
            print(f'FAILED: {name}: {case}', file=sys.stderr)
        passed, failed = passed + good, failed + len(bad)
    print(passed, failed)


if __name__ == '__main__':
    main()
