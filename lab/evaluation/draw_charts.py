#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Draws the charts that terrainseg-eval describes: FOLDER/NAME.chart.json becomes FOLDER/NAME.png.
usage: lab/evaluation/draw_charts.py FOLDER..."""
import json
import pathlib
import sys

try:
    import matplotlib
    matplotlib.use('Agg')
    from matplotlib import pyplot, ticker
except ImportError:
    sys.exit('draw_charts.py: matplotlib is missing: apt install python3-matplotlib')

MOST_MARKS = 50  # points of a curve that are marked one by one


def draw(path):
    chart = json.loads(path.read_text())
    figure, left = pyplot.subplots(figsize=(9.8, 4.1), layout='constrained')
    right = left.twinx() if any(curve['right'] for curve in chart['curves']) else None
    for i, curve in enumerate(chart['curves']):
        marks = len(curve['points']) <= MOST_MARKS
        (right if curve['right'] else left).plot(
            *(zip(*curve['points']) if curve['points'] else ([], [])), color=f'C{i}', linewidth=1,
            marker='os'[not curve['right']] if marks else None, markersize=4,
            label=curve['name'] + ' (right)' * curve['right'])
    for axis, name in ((left, chart['left']), (right, chart['right'])):
        if axis:
            axis.set_ylabel(name)
            axis.set_ylim(0, 1.08 * max((y for line in axis.lines for y in line.get_ydata()), default=0) or 1)
    left.set(title=chart['title'], xlabel=chart['x'])
    left.xaxis.set_major_locator(ticker.MaxNLocator(integer=True))
    left.grid(color='0.9')
    if chart['curves']:
        handles = [line for axis in (left, right) if axis for line in axis.lines]
        left.legend(handles=handles, loc='upper left', bbox_to_anchor=(1.1 if right else 1.02, 1))
    figure.savefig(path.with_name(path.name.removesuffix('.chart.json') + '.png'), dpi=100)
    pyplot.close(figure)


def main(folders):
    if not folders or folders[0] in ('-h', '--help'):
        print(__doc__)
        return 0 if folders else 2
    for folder in folders:
        if not pathlib.Path(folder).is_dir():
            print(f'draw_charts.py: {folder}: no such folder', file=sys.stderr)
            return 2
        for path in sorted(pathlib.Path(folder).glob('*.chart.json')):
            draw(path)
    return 0


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
