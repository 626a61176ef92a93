#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Makes sets of stills of clips and photographs that have no labels, with outlines drawn by hand (hand_labels.json).

usage: hand_labels.py DATA OUT     then: terrainseg-eval --baselines OUT/*/

They were drawn on 25 November 2026, after all that is measured with them was built, from the pictures alone: nothing is tuned on them. DATA
holds `video/` and `hd_frames/`; what is missing there is named and left out. A frame of hand_labels.json has its `source`, in a clip the
number of the `frame`, and `layers`, painted one over the other: the label of a polygon whose corners are percent of width and height.
Where nothing is painted something stands, or the sky is. A band of three pixels along the ground's border is not scored, nor what is
`unknown`: verges and grass on which one could drive, text burnt in, the vehicle's bonnet.
"""
import json
import pathlib
import sys

import cv2
import numpy

WIDTH = 640
BAND = 3
LABELS = {'obstacle': 0, 'ground': 1, 'unknown': 255}


class Clips:
    """Frames by number; reads each clip once where frames are asked for in order."""

    def __init__(self, data):
        self.data, self.path, self.capture, self.next = data, None, None, 0

    def frame(self, source, number):
        path = self.data / source
        if number is None:
            return cv2.imread(str(path))
        if path != self.path or number < self.next:
            self.path, self.capture, self.next = path, cv2.VideoCapture(str(path)), 0
        while self.next < number and self.capture.grab():
            self.next += 1
        self.next += 1
        return self.capture.read()[1]


def painted(layers, width, height):
    labels = numpy.zeros((height, width), numpy.uint8)
    for layer in layers:
        corners = [[round(x * width / 100), round(y * height / 100)] for x, y in layer['polygon']]
        cv2.fillPoly(labels, [numpy.array(corners, numpy.int32)], LABELS[layer['label']])
    ground = (labels == LABELS['ground']).astype(numpy.uint8)
    around = numpy.ones((2 * BAND + 1, 2 * BAND + 1), numpy.uint8)
    labels[cv2.dilate(ground, around) != cv2.erode(ground, around)] = LABELS['unknown']
    return labels


def write(folder, name, about, clips):
    """The number of frames that could be read."""
    count, height = 0, 0
    for frame in about['frames']:
        picture = clips.frame(frame['source'], frame.get('frame'))
        if picture is None:
            print(f'{name}: {frame["source"]} cannot be read: left out', file=sys.stderr)
            continue
        height = round(WIDTH * picture.shape[0] / picture.shape[1]) & ~1
        for kind, image in (('frames', cv2.resize(picture, (WIDTH, height), interpolation=cv2.INTER_AREA)),
                            ('labels', painted(frame['layers'], WIDTH, height))):
            (folder / kind).mkdir(parents=True, exist_ok=True)
            cv2.imwrite(str(folder / kind / f'{count:04d}.png'), image)
        count += 1
    if count:
        (folder / 'sequence.json').write_text(json.dumps(
            {'name': name, 'fps': 1, 'width': WIDTH, 'height': height, 'stills': True,
             'window_bottom': height * about['window_bottom_percent'] // 100}, indent=1) + '\n')
    return count


def main():
    if len(sys.argv) != 3 or not pathlib.Path(sys.argv[1]).is_dir():
        sys.exit(__doc__)
    data, out = map(pathlib.Path, sys.argv[1:])
    sets = json.loads(pathlib.Path(__file__).with_suffix('.json').read_text())
    counts = {name: write(out / name, name, about, Clips(data)) for name, about in sets.items()}
    print(', '.join(f'{name} {count}' for name, count in counts.items()))
    if not any(counts.values()):
        sys.exit(f'hand_labels.py: {data} holds none of the clips: give it the folder that holds video/ and hd_frames/')


if __name__ == '__main__':
    main()
