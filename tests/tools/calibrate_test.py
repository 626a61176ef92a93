#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""terrainseg-calibrate as people call it. TERRAINSEG_CALIBRATE is the program."""
import json
import math
import os
import pathlib
import re
import resource
import subprocess
import sys

import cv2
import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))
from tap import contains, equal, main  # noqa: E402

CASES = []
K = np.array([[554.25, 0, 320.5], [0, 554.25, 240.5], [0, 0, 1]])
HEIGHT, PITCH = 0.5, math.radians(10)


def case(function):
    CASES.append(function)
    return function


def calibrate(*arguments, code=0):
    result = subprocess.run([os.environ['TERRAINSEG_CALIBRATE'], *map(str, arguments)], capture_output=True, text=True, timeout=200,
                            stdin=subprocess.DEVNULL)
    assert result.returncode == code, f'{arguments}: exit {result.returncode}: {result.stderr}{result.stdout}'
    return result.stdout if code == 0 else result.stdout + result.stderr


def camera_yaml(width=640, height=480):
    text = (f'image_width: {width}\nimage_height: {height}\ncamera_matrix:\n  rows: 3\n  cols: 3\n'
            f'  data: [{", ".join(str(x) for x in K.ravel())}]\ndistortion_coefficients:\n  data: [0, 0, 0, 0, 0]\n')
    pathlib.Path('camera.yaml').write_text(text)


def row_of(distance, height=HEIGHT, pitch=PITCH):
    """Of a point straight ahead."""
    return K[1, 2] + K[1, 1] * math.tan(math.atan2(height, distance) - pitch)


def numbers(path):
    import yaml
    return yaml.safe_load(pathlib.Path(path).read_text())


def points(*distances):
    return [f'--point=320.5,{row_of(d):.3f},{d}' for d in distances]


def chessboard(columns, rows, square=60):
    board = np.full(((rows + 3) * square, (columns + 3) * square), 255, np.uint8)
    for y in range(rows + 1):
        for x in range(columns + 1):
            if (x + y) % 2 == 0:
                board[(y + 1) * square:(y + 2) * square, (x + 1) * square:(x + 2) * square] = 0
    return board


def render(board, turn, place, columns, rows, square=60):
    """The board through the camera K: metres = squares, its middle at `place`, turned by the vector `turn`."""
    rotation, _ = cv2.Rodrigues(np.array(turn, float))
    # From pixels of the board's picture to metres (centres of pixels at whole numbers) to the camera.
    to_metres = np.array([[1 / square, 0, 0.5 / square - (columns + 3) / 2], [0, 1 / square, 0.5 / square - (rows + 3) / 2], [0, 0, 1]])
    homography = K @ np.column_stack([rotation[:, 0], rotation[:, 1], np.array(place, float)]) @ to_metres
    # Four times as large and reduced: edges as a sensor sees them.
    large = np.array([[4, 0, 1.5], [0, 4, 1.5], [0, 0, 1]])
    picture = cv2.warpPerspective(board, large @ homography, (2560, 1920), flags=cv2.INTER_LINEAR, borderValue=128)
    return cv2.GaussianBlur(cv2.resize(picture, (640, 480), interpolation=cv2.INTER_AREA), (0, 0), 0.6)


VIEWS = [((0.5, 0, 0), (0, 0, 14)), ((-0.5, 0.2, 0.1), (-2, 1, 15)), ((0, 0.6, 0), (2, -1, 15)), ((0.1, -0.6, 0.2), (-3, -2, 17)),
         ((0.4, 0.4, -0.2), (3, 2, 17)), ((-0.4, -0.4, 0.3), (-2, 2, 16)), ((0.3, -0.5, 0), (3, -2, 18)), ((0, 0, 0.4), (0, 0, 13)),
         ((-0.6, 0, -0.3), (1, -2, 16)), ((0.2, 0.5, 0.5), (-3, 1, 17))]


@case
def a_chessboard_gives_the_lens(folder):
    os.mkdir('views')
    for index, (turn, place) in enumerate(VIEWS):
        cv2.imwrite(f'views/{index:02d}.png', render(chessboard(8, 6), turn, place, 8, 6))
    cv2.imwrite('views/empty.png', np.full((480, 640), 90, np.uint8))
    pathlib.Path('views/notes.txt').write_text('no picture')
    text = calibrate('camera', 'views', '--board', '8x6', '--out', 'lens.yaml')
    contains(text, '10 views')
    contains(text, 'empty.png: no complete board found')
    lens = numbers('lens.yaml')
    equal((lens['image_width'], lens['image_height'], lens['distortion_model']), (640, 480, 'plumb_bob'))
    found = np.array(lens['camera_matrix']['data']).reshape(3, 3)
    assert np.abs(found - K).max() < 2.5, found
    d = np.array(lens['distortion_coefficients']['data'])
    equal(len(d), 5, 'coefficients')
    # The whole model against the truth: pixels of a lattice are the same rays to 0.003.
    lattice = np.array([[[x, y]] for x in range(60, 600, 60) for y in range(60, 440, 60)], float)
    rays = cv2.undistortPointsIter(lattice, found, d, None, None, (3, 200, 1e-14)).reshape(-1, 2)
    truth = (lattice.reshape(-1, 2) - K[:2, 2]) / K[0, 0]
    assert np.abs(rays - truth).max() < 0.004, np.abs(rays - truth).max()
    # What was written is read again, by the tool itself.
    calibrate('mount', '--camera-info', 'lens.yaml', *points(1.0, 3.0))
    error = calibrate('camera', 'views', '--board', '12x9', code=1)
    contains(error, 'found in 0 of 11 pictures, 5 are needed')


@case
def pictures_without_a_board_take_no_long(folder):
    """Leaves, gravel: the finder of quadrangles spends seconds on each such picture."""
    os.mkdir('views')
    blocks = np.random.default_rng(1).integers(0, 256, (181, 321)).astype(np.uint8)
    for index in range(6):
        cv2.imwrite(f'views/{index}.png', cv2.resize(np.roll(blocks, index), (1920, 1080), interpolation=cv2.INTER_NEAREST))
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    contains(calibrate('camera', 'views', '--board', '8x6', code=1), 'found in 0 of 6 pictures')
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = after.ru_utime - before.ru_utime
    assert spent < 15, f'{spent:.1f} s of processor time'


@case
def two_points_give_the_mount_and_a_picture(folder):
    camera_yaml()
    cv2.imwrite('frame.png', np.full((480, 640, 3), 100, np.uint8))
    text = calibrate('mount', '--camera-info', 'camera.yaml', *points(1.0, 3.0), '--frame', 'frame.png', '--picture', 'grid.png', '--x', '0.2')
    contains(text, 'height 0.500 m')
    contains(text, 'pitch 10.00 degrees')
    residuals = [float(value) for value in re.findall(r'([+-]\d+\.\d\d) rows', text)]
    assert len(residuals) == 2 and max(map(abs, residuals)) <= 0.02, text
    mount = numbers('mount.yaml')['mount']
    assert abs(mount['height'] - HEIGHT) < 1e-4 and abs(mount['pitch'] - PITCH) < 1e-4, mount
    equal((mount['roll'], mount['x']), (0, 0.2))
    grid = cv2.imread('grid.png').astype(int)
    equal(grid.shape, (480, 640, 3))
    # The line across at 3 m from the origin is 2.8 m from the lens. Left of its figures, and yellow as far as it is drawn soft.
    row = row_of(3 - 0.2)
    yellow = grid[..., 1:].min(axis=2) > grid[..., 0] + 50
    rows = [r for r in range(480) if yellow[r, 100:300].mean() > 0.5]
    assert any(abs(r - row) <= 1 for r in rows), (row, rows)


@case
def points_of_a_frame_of_another_size(folder):
    camera_yaml()
    cv2.imwrite('half.png', np.zeros((240, 320, 3), np.uint8))
    pathlib.Path('points.csv').write_text(''.join(f'160,{(row_of(d) + 0.5) / 2 - 0.5:.3f},{d}  # tape\n' for d in (1, 2, 5)))
    text = calibrate('mount', '--camera-info', 'camera.yaml', '--points', 'points.csv', '--frame', 'half.png', '--out', 'm.yaml')
    contains(text, 'height 0.500 m')
    cv2.imwrite('cut.png', np.zeros((240, 240, 3), np.uint8))
    error = calibrate('mount', '--camera-info', 'camera.yaml', '--points', 'points.csv', '--frame', 'cut.png', code=1)
    contains(error, 'a cut-out needs a calibration of its own')


def lines(row, frames=60):
    with open('terrain.jsonl', 'w') as file:
        for i in range(frames):
            print(json.dumps({'frame': i, 'width': 640, 'height': 480, 'horizon': {'row': row + i % 3 - 1, 'confidence': 200}}), file=file)


@case
def a_recording_agrees_or_does_not(folder):
    camera_yaml()
    mount = 'height=0.5,pitch=10deg'
    lines(146)
    contains(calibrate('check', 'terrain.jsonl', '--camera-info', 'camera.yaml', '--mount', mount), 'they agree')
    lines(165)
    text = calibrate('check', 'terrain.jsonl', '--camera-info', 'camera.yaml', '--mount', mount, code=1)
    contains(text, 'lower: they do not agree')
    contains(text, 'repeat terrainseg-calibrate mount')
    lines(146, 20)
    contains(calibrate('check', 'terrain.jsonl', '--camera-info', 'camera.yaml', '--mount', mount, code=1), '30 are needed')


@case
def what_is_wrong_is_said(folder):
    camera_yaml()
    pathlib.Path('broken.yaml').write_text('image_width: [')
    for arguments, code, part in [
            ((), 2, 'camera FOLDER'),
            (('lens',), 2, "'lens' is not a command"),
            (('mount',), 2, '--camera-info FILE is missing'),
            (('mount', '--camera-info', 'camera.yaml'), 2, 'no --point is given'),
            (('mount', '--camera-info', 'camera.yaml', '--point', '1,2'), 2, 'column,row,metres'),
            (('mount', '--camera-info', 'none.yaml', *points(1, 3)), 1, 'none.yaml'),
            (('mount', '--camera-info', 'broken.yaml', *points(1, 3)), 1, 'broken.yaml: it is not YAML'),
            (('mount', '--camera-info', 'camera.yaml', *points(1, 3), '--picture', 'x.png'), 2, '--frame FILE'),
            (('mount', '--camera-info', 'camera.yaml', *points(1, 3), '--out', 'no/such/mount.yaml'), 1, 'no/such'),
            (('mount', '--camera-info', 'camera.yaml', *points(1)), 1, 'two points are needed'),
            (('mount', '--camera-info', 'camera.yaml', *points(1, 3), '--roll', '400'), 2, 'half a turn'),
            (('camera',), 2, 'FOLDER is missing'),
            (('camera', 'nowhere'), 1, 'nowhere: No such file'),
            (('camera', '.'), 1, 'no pictures in it'),
            (('camera', '.', '--board', '9'), 2, 'COLUMNSxROWS'),
            (('check', '--camera-info', 'camera.yaml', '--mount', 'height=0.5'), 2, 'nothing to check'),
            (('check', 'none.jsonl', '--camera-info', 'camera.yaml', '--mount', 'height=0.5'), 1, 'none.jsonl: cannot be opened'),
            (('check', 'broken.yaml', '--camera-info', 'camera.yaml', '--mount', 'height=0.5'), 1, 'line 1: no JSON line'),
            (('check', 'x', '--camera-info', 'camera.yaml', '--mount', 'height=0'), 1, 'height = 0')]:
        contains(calibrate(*arguments, code=code), part)
    assert not os.path.exists('mount.yaml'), 'a mount was written in spite of an error'


main(CASES)
