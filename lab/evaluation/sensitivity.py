#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""How much each constant of the default pipeline matters: moved by a quarter down and up, one at a time.

usage: sensitivity.py EVAL DATA [--stills | --rendered] [NAME...]

EVAL is terrainseg-eval: it sets constants without a rebuild, and lists them (`terrainseg-eval tuning`). DATA is a folder of labelled
sequences: its drives are measured, with --stills its stills, with --rendered rendered drives at 30 Hz instead (where motion speaks),
and of the constants those that are of the places then. NAMEs (room.constant) measure these only. Prints a Markdown table: mean
error and unsafe pixels over the sequences, in per cent, as they are and with each change.
"""
import json
import pathlib
import subprocess
import sys
import tempfile

# Shifts, counts of rows and limits of the integers' ranges are left out: a quarter of them is nothing, or is no choice.
CONSTANTS = '''
boundary: edge_limit edge_per_octave shadow_limit shadow_per_grey step_price least_step_price upright_per_octave upright_floor
  leave_price behind_price edgeless_price
color_bins: bins_per_octave
connected_ground: sky_is_smoother dark_luma taught_chroma vouched_chroma vouched_darker least_texture
exposure: target_mean
geodesic: free_distance most greatest_own_step
ground_behind: free_below follow_below margin least_sum
light_ahead: widest_part sunlit blue
likelihood: score_limit speaks_for_ground other_light_share least_of_vouched rest_is_ground rest_of_taught color_weight color_limit other_chroma texture_weight
local_reference: follow_below free_below greatest
odd_spots: box_size shadow_reach dark_enough odd_enough seed_enough seed_reach growth_reach
  far_nearest_rows far_seed_enough
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
local_reference: follow_below free_below greatest
odd_spots: box_size shadow_reach dark_enough odd_enough seed_enough seed_reach growth_reach
  far_nearest_rows far_seed_enough
row_prior: middle
stone_field: box_reach trim odd_enough seed_enough seed_reach stone_peak sure_width sure_height sure_peak
  least_sure least_share
'''
OF_RENDERED = '''
boundary: leave_price edgeless_price
connected_ground: taught_chroma vouched_chroma
motion_obstacles: far_rows memory still_memory most_coasted settling least_information
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
            yield f'{file}.{word}'


def changed(value, part):
    moved = round(value * part)
    return moved if moved != value else value + (1 if part > 1 else -1)


def is_stills(folder):
    about = folder / 'sequence.json'
    return about.exists() and json.loads(about.read_text()).get('stills', False)


class Evaluation:
    def __init__(self, program, sequences):
        self.program, self.sequences = program, sequences
        listed = subprocess.run([program, 'tuning'], check=True, capture_output=True, text=True).stdout
        self.values = {name: int(value) for name, value in (line.split() for line in listed.splitlines())}

    def measure(self, *engines):
        """Mean error and unsafe pixels of each engine."""
        with tempfile.TemporaryDirectory() as folder:
            result = pathlib.Path(folder) / 'result.json'
            options = [word for engine in engines for word in ('--engine', engine)]
            subprocess.run([self.program, *options, '--json', result, *self.sequences], check=True,
                           stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            runs = json.loads(result.read_text())['runs']
        means = []
        for engine in engines:
            of_engine = [run['ground'] for run in runs if run['engine'] == engine]
            means.append([sum(ground[figure] for ground in of_engine) / len(of_engine) for figure in ('error', 'unsafe')])
        return means


def main():
    options = [word for word in sys.argv[1:] if word.startswith('-')]
    words = [word for word in sys.argv[1:] if not word.startswith('-')]
    if len(words) < 2 or options not in ([], ['--stills'], ['--rendered']):
        sys.exit(__doc__)
    stills = options == ['--stills']
    sequences = sorted(p.parent for p in pathlib.Path(words[1]).glob('*/labels') if is_stills(p.parent) == stills)
    of = OF_STILLS if stills else CONSTANTS
    if options == ['--rendered']:
        sequences, of = RENDERED, OF_RENDERED
    if not sequences:
        sys.exit(f'sensitivity.py: {words[1]} holds no such sequence (a folder with frames/ and labels/)')
    evaluation = Evaluation(words[0], sequences)
    names = words[2:] or list(constants(of))
    unknown = [name for name in names if name not in evaluation.values]
    if unknown:
        sys.exit(f'sensitivity.py: terrainseg-eval tuning has no {", ".join(unknown)}')
    [(error, unsafe)] = evaluation.measure('default')
    print('| constant | a quarter less | a quarter more |\n|---|---|---|')
    print(f'| (as they are) | {error:.2f} / {unsafe:.1f} | {error:.2f} / {unsafe:.1f} |')
    moves = []
    for name in names:
        values = [changed(evaluation.values[name], part) for part in (0.75, 1.25)]
        figures = evaluation.measure(*(f'default,tuning.{name}={value}' for value in values))
        moves += [(pair[0] - error, f'{name} = {value}') for value, pair in zip(values, figures)]
        cells = [f'{value}: {pair[0]:.2f} / {pair[1]:.1f}' for value, pair in zip(values, figures)]
        print(f'| {name} | {cells[0]} | {cells[1]} |', flush=True)
    moves.sort()
    print(f'\nMean error: {moves[0][0]:+.2f} ({moves[0][1]}) to {moves[-1][0]:+.2f} ({moves[-1][1]}).')


if __name__ == '__main__':
    main()
