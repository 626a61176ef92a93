#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""lab/evaluation/draw_charts.py: each described chart becomes a picture that shows its curves."""
import json
import pathlib
import sys

import cv2
import numpy

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / 'tests'))
from tap import contains, equal, main, said_by  # noqa: E402

TOOL = pathlib.Path(__file__).resolve().parent.parent / 'evaluation' / 'draw_charts.py'
CASES = []


def case(function):
    CASES.append(function)
    return function


def run(*arguments, code=0):
    return said_by(TOOL, *arguments, code=code)


def write(folder, name, *curves):
    chart = {'title': 't', 'x': 'x', 'left': 'l', 'right': 'r',
             'curves': [{'name': 'c', 'right': right, 'points': points} for right, points in curves]}
    (folder / f'{name}.chart.json').write_text(json.dumps(chart))


def colored(path):
    """Pixels of the colours of curves: neither grey nor white."""
    picture = cv2.imread(str(path)).astype(int)
    return numpy.count_nonzero(picture.max(axis=2) - picture.min(axis=2) > 60)


@case
def curves_of_both_axes_are_drawn(folder):
    line = [[0, 1], [1, 0.5], [2, 3]]
    write(folder, 'none')
    write(folder, 'left', (False, line))
    write(folder, 'both', (False, line), (True, [[0, 200], [2, 100]]))
    write(folder, 'empty-curve', (False, []))
    write(folder, 'long', (False, [[i, i % 7] for i in range(400)]))
    run(folder)
    ink = {name: colored(folder / f'{name}.png') for name in ('none', 'left', 'both', 'empty-curve', 'long')}
    equal(ink['none'], 0)
    assert 300 < ink['left'] < ink['both'] and ink['left'] < ink['long'], ink


@case
def it_says_how_to_call_it_and_what_is_missing(folder):
    contains(run('--help'), 'usage:')
    contains(run(code=2), 'usage:')
    contains(run(folder / 'nowhere', code=2), 'nowhere: no such folder')
    equal(run(folder), '', 'a folder without charts')


if __name__ == '__main__':
    main(CASES)
