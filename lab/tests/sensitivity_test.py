#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""lab/evaluation/sensitivity.py: each constant is moved alone, and the differences are those of each kind of place."""
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / 'tests'))
from tap import contains, equal, main, said_by  # noqa: E402

TOOL = pathlib.Path(__file__).resolve().parent.parent / 'evaluation' / 'sensitivity.py'
# In place of terrainseg-eval: a town (two sequences) whose error is a.one, and snow whose error is a.two / 10.
EVAL = '''#!/usr/bin/env python3
import json, sys
values = {'a.one': 10, 'a.two': 1, 'b.three': -20}
if sys.argv[1] == 'tuning':
    print('\\n'.join(f'{name} {value}' for name, value in values.items()))
    sys.exit()
words, runs = sys.argv[1:], []
if 'gone' in words:
    sys.exit('gone: cannot be read')
file = words[words.index('--json') + 1]
engines = [words[i + 1] for i, word in enumerate(words) if word == '--engine']
for engine in engines:
    now = dict(values)
    for change in engine.split(',')[1:]:
        name, value = change.removeprefix('tuning.').split('=')
        now[name] = int(value)
    for sequence in words[words.index(file) + 1:]:
        error = now['a.two'] / 10 if sequence.endswith('snow') else now['a.one'] + sequence.endswith('noon')
        runs.append({'sequence': sequence, 'engine': engine, 'kind': 'snow' if sequence.endswith('snow') else 'town',
                     'ground': {'error': error, 'unsafe': None if sequence.endswith('snow') else 2 * error}})
json.dump({'runs': runs}, open(file, 'w'))
'''
CASES = []


def case(function):
    CASES.append(function)
    return function


def run(folder, *arguments, code=0):
    program = folder / 'eval'
    program.write_text(EVAL)
    program.chmod(0o755)
    return said_by(TOOL, program, *arguments, code=code)


@case
def each_constant_is_moved_alone(folder):
    lines = run(folder, 'noon', 'dusk', 'snow').splitlines()
    equal(lines[:2], ['| constant | town | snow |', '|---|---|---|'], 'kinds')
    equal(lines[2], '| as they are | 10.50 / 21.0 | 0.10 / 0.0 |', 'as they are')
    equal(lines[3:], ['| a.one=6 | -4.00 / -8.0 | +0.00 / +0.0 |', '| a.one=16 | +6.00 / +12.0 | +0.00 / +0.0 |',
                      '| a.two=0 | +0.00 / +0.0 | -0.10 / +0.0 |', '| a.two=2 | +0.00 / +0.0 | +0.10 / +0.0 |',
                      '| b.three=-12 | +0.00 / +0.0 | +0.00 / +0.0 |', '| b.three=-32 | +0.00 / +0.0 | +0.00 / +0.0 |'], 'changes')


@case
def a_folder_of_sequences_is_all_of_them(folder):
    for name in ('noon', 'snow'):
        (folder / 'data' / name / 'labels').mkdir(parents=True)
    lines = run(folder, folder / 'data', '--names', 'a.one', '--parts', '2').splitlines()
    equal(lines[2:], ['| as they are | 11.00 / 22.0 | 0.10 / 0.0 |', '| a.one=20 | +10.00 / +20.0 | +0.00 / +0.0 |'], 'rows')


@case
def what_is_wrong_is_said(folder):
    contains(run(folder, 'noon', '--names', 'c', code=1), 'no tuned constant begins with c')
    contains(run(folder, 'gone', code=1), 'gone: cannot be read')


if __name__ == '__main__':
    main(CASES)
