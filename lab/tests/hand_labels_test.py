#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""lab/evaluation/hand_labels.py: the sets that it makes of what is there, the labels that it paints, and what it says of the rest."""
import collections
import json
import pathlib
import sys

import cv2
import numpy

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / 'tests'))
from ffmpeg import ffmpeg  # noqa: E402
from tap import contains, equal, main, said_by  # noqa: E402

TOOL = pathlib.Path(__file__).resolve().parent.parent / 'evaluation' / 'hand_labels.py'
SETS = json.loads(TOOL.with_suffix('.json').read_text())
CASES = []


def case(function):
    CASES.append(function)
    return function


def run(*arguments, code=0):
    return said_by(TOOL, *arguments, code=code)


def read(path):
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert image is not None, path
    return image


@case
def a_photograph_is_labelled_as_it_is_outlined(folder):
    (folder / 'hd_frames').mkdir()
    cv2.imwrite(str(folder / 'hd_frames' / '0000.jpg'), numpy.full((1080, 1920, 3), (40, 80, 120), numpy.uint8))
    said = run(folder, folder / 'out')
    contains(said, 'robot_offroad 1')
    contains(said, 'hd_frames/0001.jpg cannot be read: left out')
    equal(sorted(p.name for p in (folder / 'out').iterdir()), ['robot_offroad'])
    made = folder / 'out' / 'robot_offroad'
    about = json.loads((made / 'sequence.json').read_text())
    equal([about[key] for key in ('stills', 'width', 'height', 'window_bottom')], [True, 640, 360, 0])
    equal(read(made / 'frames' / '0000.png').shape, (360, 640, 3))
    labels = read(made / 'labels' / '0000.png')
    # The ground before the camera, the bollard, the trees, plants that may be driven over, the band along the ground's upper edge.
    for x, y, label in ((64, 300, 1), (226, 126, 0), (320, 30, 0), (550, 250, 255), (128, 79, 255)):
        equal(int(labels[y, x]), label, f'label at {x}, {y}')


@case
def frames_of_a_clip_are_those_of_their_numbers(folder):
    (folder / 'video').mkdir()
    # Each frame has a grey of its own: 16 + its number.
    ffmpeg('-f', 'lavfi', '-i', 'color=black:size=320x180:rate=10:duration=20,format=gray,geq=lum=16+N', '-pix_fmt', 'bgr0', '-c:v', 'ffv1',
           '-f', 'matroska', folder / 'video' / 'forest_road_360p.mp4')
    said = run(folder, folder / 'out')
    wanted = [frame['frame'] for frame in SETS['forest_road']['frames'] if frame['frame'] < 200]
    contains(said, f'forest_road {len(wanted)}')
    for count, number in enumerate(wanted):
        picture = read(folder / 'out' / 'forest_road' / 'frames' / f'{count:04d}.png')
        equal(int(picture[100, 100, 0]), 16 + number, f'grey of frame {number}')


@case
def without_any_clip_it_says_what_is_missing(folder):
    (folder / 'empty').mkdir()
    contains(run(folder / 'empty', folder / 'out', code=1), 'holds none of the clips')
    contains(run(folder / 'nowhere', folder / 'out', code=1), 'usage:')


@case
def outlines_lie_in_their_pictures_and_each_frame_has_ground(_):
    for name, about in SETS.items():
        numbers = collections.Counter((frame['source'], frame.get('frame')) for frame in about['frames'])
        equal(max(numbers.values()), 1, f'{name}: a frame twice')
        for frame in about['frames']:
            kinds = [layer['label'] for layer in frame['layers']]
            assert 'ground' in kinds and set(kinds) <= {'ground', 'unknown', 'obstacle'}, (name, kinds)
            for layer in frame['layers']:
                assert len(layer['polygon']) >= 3, (name, layer)
                assert all(0 <= value <= 100 for corner in layer['polygon'] for value in corner), (name, layer)


if __name__ == '__main__':
    main(CASES)
