#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Writes labelled sequences as other cameras would have seen them.

usage: other_cameras.py DATA OUT SEED...

For each folder DATA/NAME with frames/, labels/ and sequence.json, and each seed, it writes OUT/NAME__SEED. Each
still, or each whole sequence, has random changes of its own: up to 10 % is cut off at the bottom (where no
bonnet is in view) and at either side, 15 % at the top, mirrored or not, rolled by up to 2 degrees, reduced to
75 % of the size or less, gamma 0.75 to 1.35, white balance +-7 %, saturation 0.6 to 1.25, contrast about 45 % of
the range 0.8 to 1.1, noise of up to 5 grey levels, and JPEG of quality 50 to 95. A hint of the horizon is left
out. Needs OpenCV and NumPy.
"""
import json
import pathlib
import sys

import cv2
import numpy as np


def camera(random):
    return {'bottom': random.uniform(0, .10), 'top': random.uniform(0, .15), 'left': random.uniform(0, .10),
            'right': random.uniform(0, .10), 'mirrored': random.random() < .5, 'gamma': random.uniform(.75, 1.35),
            'balance': random.uniform(.93, 1.07, 3), 'saturation': random.uniform(.6, 1.25),
            'noise': random.uniform(0, 5), 'quality': int(random.uniform(50, 96)),
            'scale': random.uniform(.75, 1), 'roll': random.uniform(-2, 2), 'contrast': random.uniform(.8, 1.1)}


def moved(picture, labels, c, bonnet):
    height, width = picture.shape[:2]
    # Enlarged so that no corner is seen.
    grown = 1 + abs(np.sin(np.radians(c['roll']))) * max(height / width, width / height) * 1.02
    turn = cv2.getRotationMatrix2D((width / 2, height / 2), c['roll'], grown)
    picture = cv2.warpAffine(picture, turn, (width, height), flags=cv2.INTER_LINEAR,
                             borderMode=cv2.BORDER_REPLICATE)
    labels = cv2.warpAffine(labels, turn, (width, height), flags=cv2.INTER_NEAREST, borderValue=255)
    rows = slice(int(c['top'] * height), height - (0 if bonnet else int(c['bottom'] * height)))
    columns = slice(int(c['left'] * width), width - int(c['right'] * width))
    flip = slice(None, None, -1 if c['mirrored'] else 1)
    picture, labels = picture[rows, columns][:, flip], labels[rows, columns][:, flip]
    size = [max(64, int(side * c['scale']) // 2 * 2) for side in (picture.shape[1], picture.shape[0])]
    return (cv2.resize(picture, size, interpolation=cv2.INTER_AREA),
            cv2.resize(labels, size, interpolation=cv2.INTER_NEAREST))


def exposed(picture, c, random):
    light = np.power(picture.astype(np.float32) / 255, c['gamma']) * c['balance']
    grey = light.mean(2, keepdims=True)
    light = (grey + (light - grey) * c['saturation'] - .45) * c['contrast'] + .45
    picture = np.clip(light * 255 + random.normal(0, c['noise'], light.shape), 0, 255).astype(np.uint8)
    return cv2.imdecode(cv2.imencode('.jpg', picture, [cv2.IMWRITE_JPEG_QUALITY, c['quality']])[1], cv2.IMREAD_COLOR)


def main():
    if len(sys.argv) < 4 or not all(seed.isdigit() for seed in sys.argv[3:]):
        sys.exit(__doc__)
    data, out = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
    folders = sorted(path.parent for path in data.glob('*/sequence.json') if (path.parent / 'labels').is_dir())
    if not folders:
        sys.exit(f'{data} holds no sequence: a folder with frames/, labels/ and sequence.json')
    for seed in map(int, sys.argv[3:]):
        for folder in folders:
            described = json.loads((folder / 'sequence.json').read_text())
            random = np.random.default_rng([seed, *folder.name.encode()])
            one = camera(random)
            bonnet = described.get('window_bottom', 0)
            if bonnet:
                described['window_bottom'] = int(np.ceil(bonnet * one['scale'])) + 1
            described.pop('horizon', None)
            there = out / f'{folder.name}__{seed}'
            for part in ('frames', 'labels'):
                (there / part).mkdir(parents=True, exist_ok=True)
            (there / 'sequence.json').write_text(json.dumps(described))
            for frame in sorted((folder / 'frames').iterdir()):
                labels = cv2.imread(str(folder / 'labels' / f'{frame.stem}.png'), cv2.IMREAD_GRAYSCALE)
                picture = cv2.imread(str(frame), cv2.IMREAD_COLOR)
                if labels is None or picture is None:
                    sys.exit(f'{frame}: the frame or its label cannot be read')
                labels = cv2.resize(labels, picture.shape[1::-1], interpolation=cv2.INTER_NEAREST)
                c = camera(random) if described.get('stills') else one
                picture, labels = moved(picture, labels, c, bonnet)
                cv2.imwrite(str(there / 'frames' / f'{frame.stem}.png'), exposed(picture, c, random))
                cv2.imwrite(str(there / 'labels' / f'{frame.stem}.png'), labels)


if __name__ == '__main__':
    main()
