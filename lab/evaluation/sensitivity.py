#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""What each tuned constant changes, for each kind of place.

usage: sensitivity.py EVAL SEQUENCE... [--names NAME...] [--parts PART...] [--every N]

EVAL is terrainseg-eval: it lists the constants (`terrainseg-eval tuning`) and sets them without a rebuild. A SEQUENCE is one of
terrainseg-eval's, or a folder of such folders. Each constant whose name begins with a NAME (without --names: each one) is
multiplied by each PART (0.6 and 1.6), one at a time. Prints a Markdown table: the mean error and unsafe pixels of each kind of
place, in per cent, as they are, and the differences with each change. A constant whose changes make no difference can go. Those
of motion speak in rendered drives only.
"""
import argparse
import collections
import concurrent.futures
import json
import os
import pathlib
import subprocess
import sys
import tempfile

TOGETHER = 8  # engines that one process measures


def sequences_of(word):
    folders = sorted(labels.parent for labels in pathlib.Path(word).glob('*/labels'))
    return [str(folder) for folder in folders] or [word]


def changed(value, part):
    moved = round(value * part)
    return moved if moved != value else value + (1 if part > 1 else -1)


def measured(program, engines, sequences, every):
    """{engine: {kind: (mean error, mean unsafe pixels)}}"""
    with tempfile.TemporaryDirectory() as folder:
        result = pathlib.Path(folder) / 'result.json'
        options = [word for engine in engines for word in ('--engine', engine)] + (['--every', str(every)] if every > 1 else [])
        done = subprocess.run([program, *options, '--json', result, *sequences], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
                              text=True)
        if done.returncode != 0:
            said = done.stderr.strip() or f'{program} ended with {done.returncode}'
            sys.exit(f'sensitivity.py: {said.splitlines()[-1]}')
        runs = json.loads(result.read_text())['runs']
    sums = collections.defaultdict(lambda: collections.defaultdict(list))
    for run in runs:
        sums[run['engine']][run['kind']].append((run['ground']['error'], run['ground']['unsafe'] or 0))
    return {engine: {kind: [sum(column) / len(rows) for column in zip(*rows)] for kind, rows in kinds.items()}
            for engine, kinds in sums.items()}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('eval')
    parser.add_argument('sequences', nargs='+', metavar='SEQUENCE')
    parser.add_argument('--names', nargs='+', default=[''], metavar='NAME')
    parser.add_argument('--parts', nargs='+', type=float, default=[0.6, 1.6], metavar='PART')
    parser.add_argument('--every', type=int, default=1, metavar='N', help='only every Nth frame (not of rendered places)')
    options = parser.parse_args()
    listed = subprocess.run([options.eval, 'tuning'], check=True, capture_output=True, text=True).stdout
    values = {name: int(value) for name, value in (line.split() for line in listed.splitlines())
              if name.startswith(tuple(options.names))}
    if not values:
        sys.exit(f'sensitivity.py: no tuned constant begins with {" or ".join(options.names)}; `terrainseg-eval tuning` lists them')
    changes = [f'tuning.{name}={changed(value, part)}' for name, value in values.items() for part in options.parts]
    sequences = [sequence for word in options.sequences for sequence in sequences_of(word)]
    engines = ['default'] + [f'default,{change}' for change in changes]
    batches = [engines[i:i + TOGETHER] for i in range(0, len(engines), TOGETHER)]
    results = {}
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        for of_batch in pool.map(lambda batch: measured(options.eval, batch, sequences, options.every), batches):
            results.update(of_batch)
    base = results['default']
    print('| constant |', ' | '.join(base), '|')
    print('|---' * (len(base) + 1) + '|')
    print('| as they are |', ' | '.join(f'{error:.2f} / {unsafe:.1f}' for error, unsafe in base.values()), '|')
    for engine in engines[1:]:
        differences = [[now - before for now, before in zip(results[engine][kind], base[kind])] for kind in base]
        print(f'| {engine.removeprefix("default,tuning.")} |', ' | '.join(f'{error:+.2f} / {unsafe:+.1f}' for error, unsafe in differences), '|')


if __name__ == '__main__':
    main()
