#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""How much each constant of the default pipeline matters: moved by a quarter down and up, one at a time.

usage: sensitivity.py DATA [NAME...]

DATA is a folder of labelled sequences; NAMEs (file:constant, as the table prints them) measure these only. Works on a copy of the
source in a temporary folder, builds terrainseg-eval there once for every change (about ten seconds each, a quarter of an hour in
all), and prints a Markdown table: mean error and unsafe pixels over the sequences, in per cent, as they are and with each change.
"""
import json
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

TOP = pathlib.Path(__file__).resolve().parents[2]
# Shifts, counts of rows and limits of the integers' ranges are left out: a quarter of them is nothing, or is no choice.
CONSTANTS = '''
boundary: edge_limit edge_per_octave shadow_limit shadow_per_grey step_price least_step_price upright_per_octave upright_floor
  leave_price behind_price edgeless_price
color_bins: noise_floor brightness_slope bins_per_octave
connected_ground: sky_is_smoother dark_luma
exposure: target_mean
geodesic: free_distance most greatest_own_step
ground_behind: free_below follow_below most margin least_sum
likelihood: score_limit least_positive rest_is_ground training_share color_weight color_limit texture_weight
local_reference: follow_below free_below most
odd_spots: box_width box_height shadow_reach dark_enough odd_enough seed_enough seed_reach growth_reach
  far_nearest_rows far_seed_enough
reestimation: color_weight texture_weight limit limit_per_penalty upper_end
row_prior: strongest middle middle_per_row
window_guard: patience
'''


def constants():
    file = None
    for word in CONSTANTS.split():
        if word.endswith(':'):
            file = word[:-1]
        else:
            yield f'{file}:{word}'


def changed(value, part):
    moved = round(value * part)
    return moved if moved != value else value + (1 if part > 1 else -1)


def is_stills(folder):
    about = folder / 'sequence.json'
    return about.exists() and json.loads(about.read_text()).get('stills', False)


class Copy:
    def __init__(self, folder, sequences):
        self.folder, self.sequences = folder, sequences
        for name in ('src', 'include', 'gst', 'tests', 'docs', 'examples', 'debian'):
            shutil.copytree(TOP / name, folder / name)
        for path in TOP.glob('meson*'):
            shutil.copy(path, folder)
        subprocess.run(['meson', 'setup', folder / 'build', folder], check=True, stdout=subprocess.DEVNULL)

    def measure(self):
        subprocess.run(['ninja', '-C', self.folder / 'build', 'src/tools/terrainseg-eval'], check=True, stdout=subprocess.DEVNULL)
        result = self.folder / 'result.json'
        subprocess.run([self.folder / 'build/src/tools/terrainseg-eval', '--json', result, *self.sequences], check=True,
                       stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        runs = json.loads(result.read_text())['runs']
        return [sum(run['ground'][figure] for run in runs) / len(runs) for figure in ('error', 'unsafe')]

    def measure_with(self, name, part):
        """The figures with one constant multiplied by `part`, and what it became."""
        file, constant = name.split(':')
        places = list((self.folder / 'src').rglob(f'{file}.cpp'))
        if len(places) != 1:
            sys.exit(f'sensitivity.py: src has {len(places)} files {file}.cpp: mend the list in this script')
        path = places[0]
        text = path.read_text()
        place = re.compile(rf'(?<=[ ,]){constant} = (-?\d+)(?=[,;])')
        found = place.findall(text)
        if len(found) != 1:
            sys.exit(f'sensitivity.py: {path.name} defines {constant} {len(found)} times: mend the list in this script')
        value = changed(int(found[0]), part)
        path.write_text(place.sub(f'{constant} = {value}', text))
        try:
            return value, self.measure()
        finally:
            path.write_text(text)


def main():
    if len(sys.argv) < 2 or sys.argv[1].startswith('-'):
        sys.exit(__doc__)
    sequences = sorted(p.parent for p in pathlib.Path(sys.argv[1]).glob('*/labels') if not is_stills(p.parent))
    if not sequences:
        sys.exit(f'sensitivity.py: {sys.argv[1]} holds no sequence (a folder with frames/ and labels/)')
    names = sys.argv[2:] or list(constants())
    with tempfile.TemporaryDirectory() as folder:
        copy = Copy(pathlib.Path(folder), sequences)
        error, unsafe = copy.measure()
        print('| constant | a quarter less | a quarter more |\n|---|---|---|')
        print(f'| (as they are) | {error:.2f} / {unsafe:.1f} | {error:.2f} / {unsafe:.1f} |')
        moves = []
        for name in names:
            cells = []
            for part in (0.75, 1.25):
                value, figures = copy.measure_with(name, part)
                moves.append((figures[0] - error, f'{name} = {value}'))
                cells.append(f'{value}: {figures[0]:.2f} / {figures[1]:.1f}')
            print(f'| {name} | {cells[0]} | {cells[1]} |', flush=True)
    moves.sort()
    print(f'\nMean error: {moves[0][0]:+.2f} ({moves[0][1]}) to {moves[-1][0]:+.2f} ({moves[-1][1]}).')


if __name__ == '__main__':
    main()
