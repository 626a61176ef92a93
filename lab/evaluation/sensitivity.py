#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""How much each constant of the default pipeline matters: moved by a quarter down and up, one at a time.

usage: sensitivity.py DATA [--stills | --rendered] [NAME...]

DATA is a folder of labelled sequences: its drives are measured, with --stills its stills, with --rendered four rendered drives at
30 Hz in their place (where motion speaks), and of the constants those that are of the places then. NAMEs (file:constant, as the table
prints them) measure these only. Works on a copy of the source in a temporary folder, builds terrainseg-eval there once for every
change, and prints a Markdown table: mean error and unsafe pixels over the sequences, in per cent, as they are and with each change.
Half an hour each.
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
connected_ground: sky_is_smoother dark_luma taught_chroma vouched_chroma vouched_darker least_texture
exposure: target_mean
geodesic: free_distance most greatest_own_step
ground_behind: free_below follow_below most margin least_sum
light_ahead: widest_part sunlit blue
likelihood: score_limit speaks_for_ground other_light_share least_of_vouched rest_is_ground rest_of_taught color_weight color_limit other_chroma texture_weight
local_reference: follow_below free_below most
odd_spots: box_width box_height shadow_reach dark_enough odd_enough seed_enough seed_reach growth_reach
  far_nearest_rows far_seed_enough
own_shadow: least_lit least_dark least_ratio least_step most_chroma most_between
reestimation: color_weight texture_weight limit limit_per_penalty upper_end
row_prior: strongest middle middle_per_row
stone_field: nearest_rows box_reach least_ground trim deviation_floor odd_enough seed_enough seed_reach
  stone_width stone_height stone_peak sure_width sure_height sure_peak least_sure least_share
window_guard: patience
'''
OF_STILLS = '''
boundary: edge_limit edge_per_octave shadow_limit step_price edgeless_price
connected_ground: sky_is_smoother dark_luma taught_chroma vouched_chroma vouched_darker least_texture
light_ahead: widest_part sunlit blue
likelihood: score_limit speaks_for_ground other_light_share least_of_vouched rest_of_taught color_weight other_chroma texture_weight
local_reference: follow_below free_below most
odd_spots: box_width box_height shadow_reach dark_enough odd_enough seed_enough seed_reach growth_reach
  far_nearest_rows far_seed_enough
own_shadow: least_lit least_dark least_ratio least_step most_chroma most_between
row_prior: middle
stone_field: box_reach trim odd_enough seed_enough seed_reach stone_peak sure_width sure_height sure_peak
  least_sure least_share
'''
OF_RENDERED = '''
boundary: leave_price edgeless_price
connected_ground: taught_chroma vouched_chroma
motion_obstacles: near_rows far_rows memory still_memory most_coasted settling least_information
odd_spots: odd_enough seed_enough far_seed_enough flat_everywhere flat_on_average
parallax: most_left
row_prior: denied most_below
standing_map: least_to_appear least_to_stay
'''
RENDERED = ['scene:plain:day:straight@640x360#101-102', 'scene:trail:day:bumpy@640x360#103', 'scene:road:day:straight@640x360#104']


def constants(of):
    file = None
    for word in of.split():
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
        shutil.copytree(TOP, folder, ignore=shutil.ignore_patterns('build*', '.git'), dirs_exist_ok=True)
        subprocess.run(['meson', 'setup', folder / 'build', folder], check=True, stdout=subprocess.DEVNULL)

    def measure(self):
        subprocess.run(['ninja', '-C', self.folder / 'build', 'lab/terrainseg-eval'], check=True, stdout=subprocess.DEVNULL)
        result = self.folder / 'result.json'
        subprocess.run([self.folder / 'build/lab/terrainseg-eval', '--json', result, *self.sequences], check=True,
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
        place = re.compile(rf'(?<=[ ,]){constant} = (-?\d+)(?=(?: << \d+)?[,;])')
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
    options = [word for word in sys.argv[1:] if word.startswith('-')]
    words = [word for word in sys.argv[1:] if not word.startswith('-')]
    if not words or options not in ([], ['--stills'], ['--rendered']):
        sys.exit(__doc__)
    stills = options == ['--stills']
    sequences = sorted(p.parent for p in pathlib.Path(words[0]).glob('*/labels') if is_stills(p.parent) == stills)
    of = OF_STILLS if stills else CONSTANTS
    if options == ['--rendered']:
        sequences, of = RENDERED, OF_RENDERED
    if not sequences:
        sys.exit(f'sensitivity.py: {words[0]} holds no such sequence (a folder with frames/ and labels/)')
    names = words[1:] or list(constants(of))
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
