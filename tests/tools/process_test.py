#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""terrainseg-process as scripts use it: outputs, damage, interruption, resuming. TERRAINSEG_PROCESS is the program."""
import contextlib
import csv
import errno
import hashlib
import http.server
import itertools
import json
import math
import os
import pathlib
import pty
import resource
import select
import shutil
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
import zlib

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))
from ffmpeg import ffmpeg, mark_turned  # noqa: E402
from tap import Skip, contains, equal, installing, main  # noqa: E402

PROCESS = os.environ['TERRAINSEG_PROCESS']
KINDS = ('annotated.mp4', 'masks.mkv', 'jsonl', 'csv')
CASES = []


def case(function):
    CASES.append(function)
    return function


def run(*arguments, **options):
    return subprocess.run([PROCESS, *map(str, arguments)], capture_output=True, text=True, timeout=120,
                          stdin=subprocess.DEVNULL, **options)


def told_by(result):
    """What is on stderr besides progress, which comes when a run takes seconds."""
    return ''.join(line for line in result.stderr.splitlines(keepends=True) if not (' %  ' in line and line.endswith(' fps\n')))


def ok(*arguments, code=0, **options):
    result = run(*arguments, **options)
    assert result.returncode == code, f'exit {result.returncode} instead of {code}: {result.stderr}{result.stdout}'
    return result


def video(path, frames=12, size='64x48', rate=24, audio=False, before=(), extra=()):
    """A moving picture, H.264 unless `extra` says otherwise."""
    sound = ('-f', 'lavfi', '-i', f'sine=duration={frames / rate}') if audio else ()
    ffmpeg('-f', 'lavfi', '-i', f'testsrc2=size={size}:rate={rate}', *sound, '-frames:v', frames, '-pix_fmt', 'yuv420p',
           '-preset', 'ultrafast', '-g', '6', *extra, path)
    return path


def images(folder, frames=6, size='64x48', suffix='png', first=0):
    folder.mkdir(parents=True, exist_ok=True)
    ffmpeg('-f', 'lavfi', '-i', f'testsrc=size={size}:rate=10', '-frames:v', frames, '-start_number', first,
           folder / f'%04d.{suffix}')
    return folder


def probe(path):
    """The video stream of a file as ffprobe sees it, every frame decoded."""
    text = subprocess.run(['ffprobe', '-v', 'error', '-count_frames', '-show_streams', '-select_streams', 'v', '-of',
                           'json', str(path)], capture_output=True, text=True, check=True)
    equal(text.stderr, '', f'{path} is not clean')
    stream, = json.loads(text.stdout)['streams']
    return stream


def raw(path, pixel_format):
    return subprocess.run(['ffmpeg', '-v', 'error', '-i', str(path), '-f', 'rawvideo', '-pix_fmt', pixel_format, '-'],
                          capture_output=True, check=True).stdout


def check_outputs(base, frames, size, partial=False):
    """Every output of `base` holds `frames` frames of `size`; returns the record."""
    names = {kind: pathlib.Path(f'{base}.{"partial." if partial else ""}{kind}') for kind in KINDS}
    width, height = size
    annotated, masks = probe(names['annotated.mp4']), probe(names['masks.mkv'])
    equal((annotated['codec_name'], annotated['pix_fmt']), ('h264', 'yuv420p'), 'annotated')
    equal((masks['codec_name'], masks['pix_fmt']), ('ffv1', 'gray'), 'masks')
    equal((annotated['width'], annotated['height']), (max(16, width + width % 2), max(16, height + height % 2)),
          'annotated size')
    equal((masks['width'], masks['height']), size, 'mask size')
    lines = [json.loads(line) for line in names['jsonl'].read_text().splitlines()]
    rows = list(csv.DictReader(names['csv'].open()))
    counts = (int(annotated['nb_read_frames']), int(masks['nb_read_frames']), len(lines), len(rows))
    equal(counts, (frames,) * 4, 'frames in annotated, masks, json, csv')
    equal([line['frame'] for line in lines], list(range(frames)), 'frame numbers')
    equal([int(row['frame']) for row in rows], list(range(frames)), 'frame numbers in the CSV')
    assert set(raw(names['masks.mkv'], 'gray')) <= {0, 128, 255}
    for line, row in zip(lines, rows):
        assert abs(line['traversable'] - float(row['traversable'])) < 0.0011, (line['traversable'], row)
        equal(line['pts'], int(row['pts']), 'pts')
    record = json.loads(pathlib.Path(f'{base}.{"partial." if partial else ""}summary.json').read_text())
    equal(record['frames'], frames, 'frames in the record')
    equal(record['complete'], not partial, 'complete')
    for name, kind in zip(('annotated', 'masks', 'json', 'csv'), KINDS):
        equal(record['outputs'][name]['bytes'], names[kind].stat().st_size, f'bytes of {name}')
    return record


def left(folder):
    return sorted(path.name for path in pathlib.Path(folder).iterdir())


def outputs_of(*stems):
    return sorted(f'{stem}.{kind}' for stem in stems for kind in (*KINDS, 'summary.json'))


@case
def one_pass_and_every_output_counts_the_same(folder):
    video('drive.mp4', frames=30, size='160x120', audio=True)
    result = ok('--output-dir', 'out', 'drive.mp4')
    check_outputs('out/drive', 30, (160, 120))
    equal(left('out'), outputs_of('drive'), 'nothing else is left')
    contains(result.stdout, 'drive.mp4: 30 frames')
    contains(result.stdout, '% traversable')


@case
def times_are_those_of_the_input(folder):
    video('drive.mp4', frames=12, rate=24)
    ok('-q', '-o', 'out', 'drive.mp4')
    pts = [json.loads(line)['pts'] for line in open('out/drive.jsonl')]
    for index, each in enumerate(pts):
        assert abs(each - index * 1e9 / 24) < 2e6, (index, each)
    for name in 'annotated.mp4', 'masks.mkv':
        duration = float(subprocess.run(['ffprobe', '-v', 'error', '-show_entries', 'format=duration', '-of', 'csv=p=0',
                                         f'out/drive.{name}'], capture_output=True, text=True, check=True).stdout)
        assert abs(duration - 0.5) < 0.05, (name, duration)


def shown_times(path):
    """Nanoseconds at which a player shows the frames of a file, by ffprobe."""
    text = subprocess.run(['ffprobe', '-v', 'error', '-select_streams', 'v', '-show_entries', 'frame=pts_time', '-of',
                           'json', str(path)], capture_output=True, text=True, check=True).stdout
    return [float(frame['pts_time']) * 1e9 for frame in json.loads(text)['frames']]


@case
def times_are_those_that_a_player_shows(folder):
    b_frames = ('-preset', 'medium', '-bf', '3')
    video('b.mp4', frames=24, extra=b_frames)
    video('open.mov', frames=24, extra=b_frames)
    video('b.mkv', frames=24, extra=b_frames)
    video('ten.mp4', frames=24, extra=('-pix_fmt', 'yuv420p10le', '-c:v', 'libx265', '-x265-params', 'log-level=error'))
    # Cut at a key frame, the edit list begins at a frame.
    ffmpeg('-ss', '0.25', '-i', 'b.mp4', '-c', 'copy', 'trimmed.mp4')
    ffmpeg('-itsoffset', '0.5', '-i', 'b.mp4', '-f', 'lavfi', '-i', 'sine=duration=2', '-map', '0:v', '-map', '1:a',
           '-c:v', 'copy', 'late.mp4')
    for name in 'b.mp4', 'open.mov', 'b.mkv', 'ten.mp4', 'trimmed.mp4', 'late.mp4':
        expected = shown_times(name)
        out = f'out-{name}'
        ok('-q', '-o', out, name)
        stem = pathlib.Path(name).stem
        pts = [json.loads(line)['pts'] for line in open(f'{out}/{stem}.jsonl')]
        equal(len(pts), len(expected), f'frames of {name}')
        for index, (each, shown) in enumerate(zip(pts, expected)):
            assert abs(each - shown) < 2e6, (name, index, each, shown)
        equal([int(row['pts']) for row in csv.DictReader(open(f'{out}/{stem}.csv'))], pts, f'the CSV of {name}')


@case
def the_same_input_gives_the_same_bytes(folder):
    for name in 'abc':
        video(f'{name}.mp4', frames=10, size=f'{80 + ord(name) % 7 * 2}x60')
    ok('-q', '-o', 'one', 'a.mp4', 'b.mp4', 'c.mp4')
    ok('-q', '-o', 'two', '--jobs', 3, 'a.mp4', 'b.mp4', 'c.mp4')
    for name in 'abc':
        for kind in 'jsonl', 'csv':
            equal(pathlib.Path(f'one/{name}.{kind}').read_bytes(), pathlib.Path(f'two/{name}.{kind}').read_bytes(),
                  f'{name}.{kind}')
        equal(raw(f'one/{name}.masks.mkv', 'gray'), raw(f'two/{name}.masks.mkv', 'gray'), f'masks of {name}')


@case
def names_may_hold_anything(folder):
    stems = ['grüne Wiese – 1%d', "it's \"new\"", 'name with  spaces', '#?&=+', '-dash', 'dotted.name.v2', '道路',
             'line\nbreak']
    for stem in stems:
        video(f'./{stem}.mp4', frames=3)
    raw_name = b'latin-\xe9.mp4'
    shutil.copyfile('./-dash.mp4', raw_name)
    result = ok('-o', 'out dir/ü', '--', *(f'./{stem}.mp4' for stem in stems), os.fsdecode(raw_name),
                env=dict(os.environ, LC_ALL='C.UTF-8'), errors='replace')
    for stem in stems:
        check_outputs(f'out dir/ü/{stem}', 3, (64, 48))
    assert os.path.exists(b'out dir/\xc3\xbc/latin-\xe9.annotated.mp4')
    equal(told_by(result), '')


@case
def same_names_in_different_places_do_not_overwrite(folder):
    for place in 'a', 'b':
        os.mkdir(place)
        video(f'{place}/clip.mp4', frames=3 if place == 'a' else 5)
    video('a/clip.mkv', frames=4)
    result = ok('-o', 'out', 'a/clip.mp4', 'b/clip.mp4', 'a/clip.mkv', './a/../a/clip.mkv', code=2)
    for part in ('b/clip.mp4 and a/clip.mp4', 'a/clip.mkv and a/clip.mp4', 'out/clip.', '--names', 'nothing was written'):
        contains(result.stderr, part)
    assert not os.path.exists('out')
    # One after the other: the first keeps what it made.
    ok('-q', '-o', 'out', 'a/clip.mp4')
    result = ok('-o', 'out', 'b/clip.mp4', code=2)
    contains(result.stderr, f'was made from {folder.resolve()}/a/clip.mp4, not from b/clip.mp4')
    check_outputs('out/clip', 3, (64, 48))
    ok('-q', '-o', 'out', '--names', 'path', 'a/clip.mp4', 'b/clip.mp4')
    check_outputs('out/a/clip', 3, (64, 48))
    check_outputs('out/b/clip', 5, (64, 48))
    ok('-q', '-o', 'hashed', '--names', 'hash', 'a/clip.mp4', 'b/clip.mp4', 'a/clip.mkv')
    equal(sorted(json.load(open(f'hashed/{name}'))['frames'] for name in left('hashed') if 'summary' in name), [3, 4, 5],
          'frames of the three')


@case
def an_input_is_never_overwritten(folder):
    video('clip.mp4')
    os.rename('clip.mp4', 'annotated.mp4')
    before = pathlib.Path('annotated.mp4').read_bytes()
    for argument in ('annotated.mp4', (folder / 'annotated.mp4').as_uri(), './/annotated.mp4'):
        result = ok('--name', '', argument, code=2)
        contains(result.stderr, 'would replace the input')
        equal(pathlib.Path('annotated.mp4').read_bytes(), before, 'the input')
        equal(left('.'), ['annotated.mp4'], 'files')


@case
def an_output_of_one_input_is_never_another_input(folder):
    video('drive.mp4', frames=3)
    video('drive.annotated.mp4', frames=4)
    before = pathlib.Path('drive.annotated.mp4').read_bytes()
    result = ok('drive.mp4', 'drive.annotated.mp4', code=2)
    contains(result.stderr, 'drive.annotated.mp4 of drive.mp4 would replace the input drive.annotated.mp4')
    # Named or not, what this tool did not make from this input stays.
    contains(ok('drive.mp4', code=2).stderr, 'drive.annotated.mp4 already exists')
    os.mkdir('out')
    os.link('drive.annotated.mp4', 'out/other.annotated.mp4')
    os.rename('drive.mp4', 'other.mp4')
    contains(ok('-o', 'out', 'other.mp4', 'drive.annotated.mp4', code=2).stderr, 'would replace the input')
    equal(pathlib.Path('drive.annotated.mp4').read_bytes(), before, 'the other')
    equal(left('out'), ['other.annotated.mp4'], 'nothing was written')


@case
def a_name_can_be_given(folder):
    video('clip.mp4', frames=3)
    ok('-q', '-o', 'out', '--name', '', 'clip.mp4')
    equal(left('out'), ['annotated.mp4', 'masks.mkv', 'summary.json', 'terrain.csv', 'terrain.jsonl'], 'bare names')
    ok('-q', '-o', 'named', '--name', 'run 7', 'clip.mp4')
    equal(left('named'), outputs_of('run 7'), 'named')


@case
def outputs_can_be_chosen(folder):
    video('clip.mp4', frames=5)
    for kinds, names in (('csv', ['csv']), ('json,masks', ['jsonl', 'masks.mkv']), ('annotated', ['annotated.mp4'])):
        out = f'out-{kinds}'
        ok('-q', '-o', out, '--outputs', kinds, 'clip.mp4')
        equal(left(out), sorted(['clip.summary.json', *(f'clip.{name}' for name in names)]), kinds)
    equal(sum(1 for _ in open('out-csv/clip.csv')), 6, 'rows with the header')


@case
def the_mask_can_be_in_the_lines(folder):
    video('clip.mp4', frames=4)
    ok('-q', '-o', 'out', '--json-mask', '--outputs', 'json,masks', 'clip.mp4')
    masks = raw('out/clip.masks.mkv', 'gray')
    for index, line in enumerate(open('out/clip.jsonl')):
        mask = json.loads(line)['mask']
        equal((mask['width'], mask['height']), (64, 48), 'mask size')
        pixels = bytearray()
        for value, length in zip(mask['runs'][0::2], mask['runs'][1::2]):
            pixels += bytes([value]) * length
        equal(bytes(pixels), masks[index * 64 * 48:(index + 1) * 64 * 48], f'mask {index}')


@case
def frames_can_be_limited(folder):
    video('clip.mp4', frames=40)
    ok('-q', '-o', 'out', '--frames', 7, 'clip.mp4')
    check_outputs('out/clip', 7, (64, 48))


@case
def settings_reach_the_elements(folder):
    video('clip.mp4', frames=3, size='160x120')
    ok('-q', '-o', 'out', '--preset', 'paper', '--set', 'window-bottom=8', '--set=window-width=32', '-s',
       'window-height=16', '--set', 'overlay-style=mask', '--set', 'overlay-alpha=1', '--set',
       'ignore-regions=<<0,0,16,16>>', 'clip.mp4')
    line = json.loads(open('out/clip.jsonl').readline())
    equal(line['window'], [64, 96, 32, 16], 'window')
    contains(json.load(open('out/clip.summary.json'))['settings'], 'window-bottom=8')
    mask = raw('out/clip.masks.mkv', 'gray')
    equal(set(mask[y * 160 + x] for y in range(16) for x in range(16)), {128}, 'the ignored corner')


@case
def metres_and_the_time_of_day_are_in_the_rows(folder):
    """What the rows say is what the lines say, and without a calibration they say nothing."""
    video('clip.mp4', frames=4, size='160x90')
    pathlib.Path('camera.yaml').write_text(
        'image_width: 160\nimage_height: 90\n'
        'camera_matrix: {rows: 3, cols: 3, data: [131, 0, 79.5, 0, 131, 44.5, 0, 0, 1]}\n')
    ok('-q', '-o', 'out', '--outputs', 'json,csv', '--set', 'camera-info=camera.yaml', '--set',
       'mount=height=0.5,pitch=10deg', '--set', 'start-time=2026-11-22T20:00:00Z', '--set', 'range-max=6', 'clip.mp4')
    lines = [json.loads(line) for line in open('out/clip.jsonl')]
    rows = list(csv.DictReader(open('out/clip.csv')))
    equal([row['utc'] for row in rows], [line['utc'] for line in lines], 'time of day')
    equal(rows[0]['utc'], '2026-11-22T20:00:00.000000Z', 'time of day of the first frame')
    told = 0
    for row, line in zip(rows, lines):
        metric = line['metric']
        equal(float(row['range_max']), 6.0, 'range_max')
        for name in 'ranges', 'bearings', 'low', 'high':
            values = [float(value) for value in row[name].split(' ')]
            equal(len(values), 160, name)
            for value, expected, free in zip(values, metric[name], metric['free']):
                if math.isnan(value) or expected is None:
                    assert math.isnan(value) and expected is None, (name, value, expected)
                elif name == 'ranges' and free:
                    equal(value, math.inf, 'free')
                else:
                    assert min(value, 6.0) == expected or name == 'bearings' and value == expected, (name, value, expected)
                    told += 1
    assert told > 1000, told
    ok('-q', '-o', 'plain', '--outputs', 'csv', 'clip.mp4')
    for row in csv.DictReader(open('plain/clip.csv')):
        equal([row[name] for name in ('utc', 'range_max', 'ranges', 'bearings', 'low', 'high')], [''] * 6, 'no calibration')


@case
def wrong_usage_is_refused_before_anything_is_written(folder):
    video('clip.mp4', frames=3)
    video('other.mp4', frames=3)
    for arguments, text in (
            (['--set', 'no-such=1'], "no property 'no-such'"),
            (['--set', 'caution=101'], '-100..100'),
            (['--set', 'caution=many'], 'caution'),
            (['--set', 'horizon=sideways'], 'one of off, paper, auto'),
            (['--set', 'caution'], 'PROPERTY=VALUE'),
            (['--set', 'stages=foo'], 'any of texture, exposure, '),
            (['--set', 'overlay=true'], '--outputs'),
            (['--set', 'overlay-alpha=2'], '0..1'),
            (['--set', 'name=x'], "no property 'name'"),
            (['--set', 'stats=x'], "no property 'stats'"),
            (['--preset', 'fancy'], 'one of default, paper'),
            (['--outputs', 'json,film'], "'film'"),
            (['--outputs', ''], "''"),
            (['--fps', '0'], 'frame rate'),
            (['--fps', 'x'], 'frame rate'),
            (['--frames', '-1'], '--frames'),
            (['--quality', '0'], '--quality'),
            (['--jobs', '0'], '--jobs'),
            (['--stall-timeout', '0'], '--stall-timeout'),
            (['--names', 'mine'], 'base, path, hash'),
            (['--name', 'a/b'], "'/'"),
            (['--name', '..'], "a folder's name"),
            (['--name', '.'], "a folder's name"),
            (['--no-such-option'], 'no-such-option'),
            (['--name', 'x', 'other.mp4'], 'one input')):
        result = ok('-o', 'out', *arguments, 'clip.mp4', code=2)
        contains(result.stderr, text)
        assert not os.path.exists('out'), arguments
    contains(ok(code=2).stderr, 'no INPUT')


@case
def help_and_version(folder):
    text = ok('--help').stdout
    for part in ('--output-dir', '--resume', 'Exit codes', 'partial', '--set'):
        contains(text, part)
    assert ok('--version').stdout.startswith('terrainseg-process ')


@case
def sequences_by_pattern(folder):
    images(folder / 'frames', 6)
    ok('-q', '-o', 'out', '--fps', '5', 'frames/%04d.png')
    check_outputs('out/frames', 6, (64, 48))
    equal([json.loads(line)['pts'] for line in open('out/frames.jsonl')], [i * 200_000_000 for i in range(6)], 'pts')


@case
def sequences_by_folder_and_with_holes(folder):
    images(folder / 'ride/frames', 5, suffix='jpg', first=98)
    os.remove('ride/frames/0100.jpg')
    pathlib.Path('ride/frames/notes.txt').write_text('not an image')
    ok('-q', '-o', 'out', 'ride/frames')
    check_outputs('out/frames', 4, (64, 48))
    ok('-q', '-o', 'again', 'ride/frames/%04d.jpg')
    equal(pathlib.Path('again/frames.jsonl').read_bytes(), pathlib.Path('out/frames.jsonl').read_bytes(), 'the lines')


@case
def a_frame_rate_is_for_sequences_alone(folder):
    video('clip.mp4', frames=3, rate=24)
    images(folder / 'x', 3)
    contains(ok('-o', 'out', '--fps', '10', 'clip.mp4').stderr, 'warning: --fps is for image sequences')
    equal([json.loads(line)['pts'] for line in open('out/clip.jsonl')][1] // 1_000_000, 41, 'its own frame rate')
    assert '--fps' not in ok('-o', 'both', '--fps', '10', 'clip.mp4', 'x').stderr, 'there is a sequence'


@case
def one_image_is_a_short_sequence(folder):
    images(folder / 'x', 1)
    result = ok('-o', 'out', 'x/0000.png')
    check_outputs('out/0000', 1, (64, 48))
    contains(result.stdout, '0000.png: 1 frame, ')
    assert '1 frames' not in result.stderr, result.stderr


@case
def a_folder_of_videos(folder):
    os.mkdir('rec')
    for index in range(3):
        video(f'rec/v{index}.mp4', frames=3 + index)
    pathlib.Path('rec/readme.txt').write_text('text')
    ok('-q', '-o', 'rec', 'rec')
    for index in range(3):
        check_outputs(f'rec/v{index}', 3 + index, (64, 48))
    # The outputs of the first run, in the same folder, are no inputs of the second.
    result = ok('-o', 'rec', '--resume', 'rec')
    equal(result.stdout.count('already complete'), 3, 'skipped')
    equal(len(result.stdout.splitlines()), 4, 'lines with the tally')


@case
def images_of_several_sizes(folder):
    images(folder / 'frames', 3, size='64x48', first=0)
    images(folder / 'frames', 3, size='96x60', first=3)
    images(folder / 'frames', 2, size='33x81', first=6)
    ok('-q', '-o', 'out', 'frames')
    check_outputs('out/frames', 8, (64, 48))
    sizes = [(line['width'], line['height']) for line in map(json.loads, open('out/frames.jsonl'))]
    equal(sizes, [(64, 48)] * 3 + [(96, 60)] * 3 + [(33, 81)] * 2, 'sizes in the lines')


@case
def odd_sizes(folder):
    for size in ((65, 49), (64, 49), (33, 48), (17, 17), (8, 6), (2, 40), (40, 1)):
        name = f'odd{size[0]}x{size[1]}'
        ffmpeg('-f', 'lavfi', '-i', f'testsrc=size={size[0]}x{size[1]}:rate=24', '-frames:v', 4, '-pix_fmt', 'yuv420p',
               '-c:v', 'ffv1', f'{name}.mkv')
        equal((probe(f'{name}.mkv')['width'], probe(f'{name}.mkv')['height']), size, 'the input')
        ok('-q', '-o', 'out', f'{name}.mkv')
        check_outputs(f'out/{name}', 4, size)


@case
def a_calibration_is_that_of_the_upright_picture(folder):
    video('flat.mp4', frames=6, size='96x64')
    mark_turned('flat.mp4', 90, 'turned.mp4')
    for name, width, height in (('upright', 64, 96), ('lying', 96, 64)):
        pathlib.Path(f'{name}.yaml').write_text(
            f'image_width: {width}\nimage_height: {height}\ncamera_matrix: {{rows: 3, cols: 3, data: '
            f'[79, 0, {(width - 1) / 2}, 0, 79, {(height - 1) / 2}, 0, 0, 1]}}\n')
    mount = '--mount', 'height=1,pitch=0.3'
    ok('-q', '-o', 'out', '--camera-info', 'upright.yaml', *mount, 'turned.mp4')
    assert all('metric' in json.loads(line) for line in open('out/turned.jsonl'))
    refused = ok('-q', '-o', 'other', '--camera-info', 'lying.yaml', *mount, 'turned.mp4', code=1)
    contains(refused.stderr, '96 x 64 but the frames are 64 x 96')


@case
def padded_frames_are_decoded_every_time(folder):
    """Decoders pad frames whose width is no multiple of 16. GStreamer 1.26 aborted in two of five runs."""
    quiet = ('-x265-params', 'log-level=none', '-bf', '3')
    for name, size, encoder in (('a.mp4', '360x640', ()), ('b.mkv', '360x640', ('-c:v', 'libx265', '-preset', 'ultrafast', *quiet))):
        drive(name, *encoder, size=size, frames=40)
        for attempt in range(4):
            ok('-q', '-o', f'out{attempt}', name, env={**os.environ, 'MALLOC_PERTURB_': '210'})
            equal(len(open(f'out{attempt}/{name[0]}.jsonl').readlines()), 40, name)


@case
def rotated_video_is_turned_upright(folder):
    video('flat.mp4', frames=6, size='96x64')
    mark_turned('flat.mp4', 90, 'turned.mp4')
    ok('-q', '-o', 'out', 'flat.mp4', 'turned.mp4')
    check_outputs('out/flat', 6, (96, 64))
    check_outputs('out/turned', 6, (64, 96))


@case
def every_camera_that_was_turned_is_turned_back(folder):
    kinds = {'mp4': (), 'ten': ('-pix_fmt', 'yuv420p10le', '-c:v', 'libx265', '-x265-params', 'log-level=error'),
             'four22': ('-pix_fmt', 'yuv422p'), 'four22ten': ('-pix_fmt', 'yuv422p10le')}
    for name, extra in kinds.items():
        video('flat.mp4', frames=4, size='96x64', extra=extra)
        for angle, size in ((90, (64, 96)), (180, (96, 64)), (270, (64, 96))):
            mark_turned('flat.mp4', angle, f'{name}{angle}.mp4')
            ok('-q', '-o', 'out', f'{name}{angle}.mp4')
            check_outputs(f'out/{name}{angle}', 4, size)
            # The oracle turns by itself: the pictures must be those that ffmpeg shows, but for the drawn ground.
            ok('-q', '-o', 'plain', '--set', 'overlay-alpha=0', f'{name}{angle}.mp4')
            ours = raw(f'plain/{name}{angle}.annotated.mp4', 'gray')
            theirs = raw(f'{name}{angle}.mp4', 'gray')
            equal(len(ours), len(theirs), 'bytes')
            difference = sum(abs(a - b) for a, b in zip(ours, theirs)) / len(ours)
            assert difference < 12, (name, angle, difference)


def with_exif(picture, orientation, to):
    """A copy of a JPEG, PNG or WebP picture that says how the camera was turned."""
    data = pathlib.Path(picture).read_bytes()
    exif = b'MM\0*' + struct.pack('>IHHHIHHI', 8, 1, 0x112, 3, 1, orientation, 0, 0)
    if data.startswith(b'\xff\xd8'):
        data = data[:2] + b'\xff\xe1' + struct.pack('>H', len(exif) + 8) + b'Exif\0\0' + exif + data[2:]
    elif data.startswith(b'RIFF'):
        data += b'EXIF' + struct.pack('<I', len(exif)) + exif
        data = b'RIFF' + struct.pack('<I', len(data) - 8) + data[8:]
    else:
        chunk = b'eXIf' + exif
        data = data[:33] + struct.pack('>I', len(exif)) + chunk + struct.pack('>I', zlib.crc32(chunk)) + data[33:]
    pathlib.Path(to).write_bytes(data)


@case
def pictures_are_turned_upright_on_every_way_in(folder):
    turns = ('null', 'hflip', 'hflip,vflip', 'vflip', 'transpose=0', 'transpose=1', 'transpose=3', 'transpose=2')
    drive('flat.png', '-c:v', 'png', frames=1)
    for pixels in 'yuvj420p', 'yuvj422p':
        drive(f'{pixels}.jpg', '-q:v', '1', '-pix_fmt', pixels, frames=1)
        for number, turn in enumerate(turns, 1):
            with_exif(f'{pixels}.jpg', number, 'turned.jpg')
            ffmpeg('-i', f'{pixels}.jpg', '-vf', turn, 'upright.png')
            shutil.rmtree('out', ignore_errors=True)
            ok('-q', '-o', 'out', '--outputs', 'annotated', '--quality', '5', '--set', 'overlay-alpha=0', 'turned.jpg')
            size = '320x180' if number < 5 else '180x320'
            equal('{width}x{height}'.format(**probe('out/turned.annotated.mp4')), size, f'size of {number}')
            difference, = differences('upright.png', 'out/turned.annotated.mp4', size)
            assert difference < 8, (number, difference)
    ffmpeg('-i', 'flat.png', 'flat.webp')
    for suffix in 'png', 'webp':
        with_exif(f'flat.{suffix}', 6, f'one.{suffix}')
        ok('-q', '-o', suffix, '--outputs', 'masks', f'one.{suffix}')
        equal(probe(f'{suffix}/one.masks.mkv')['height'], 320, suffix)
    os.mkdir('frames')
    for index, number in enumerate((6, 1, 8)):  # the first decides the size, and all are upright
        with_exif('yuvj420p.jpg', number, f'frames/{index}.jpg')
    os.symlink('frames', 'link')
    os.symlink('frames/0.jpg', 'one.jpg')
    pathlib.Path('list.txt').write_text(f'one.jpg\n{(folder / "frames").as_uri()}\n')
    uri = (folder / 'frames').as_uri()
    for way, arguments, base in (('folder', ['frames'], 'frames'), ('pattern', ['frames/%d.jpg'], 'frames'), ('link', ['link'], 'link'),
                                 ('file', ['one.jpg'], 'one'), ('uri', [uri], 'frames'), ('short', [uri.replace('///', '/')], 'frames'),
                                 ('list', ['--inputs-from', 'list.txt', '--names', 'base'], 'one'), ('list', [], 'frames')):
        if arguments:
            ok('-q', '-o', way, '--outputs', 'masks,json', *arguments)
        stream = probe(f'{way}/{base}.masks.mkv')
        equal((stream['width'], stream['height']), (180, 320), way)
    equal([(line['width'], line['height']) for line in lines_of('folder/frames.jsonl')], [(180, 320), (320, 180), (180, 320)], 'frames')

@case
def a_link_to_nothing_is_not_left_out(folder):
    os.mkdir('rec')
    video('rec/there.mp4', frames=3)
    os.symlink('/nowhere/absent.mp4', 'rec/absent.mp4')
    contains(ok('-q', '-o', 'out', 'rec', code=75).stderr, 'absent.mp4')
    check_outputs('out/there', 3, (64, 48))
    os.remove('rec/absent.mp4')
    images(folder / 'frames', 3)
    os.remove('frames/0001.png')
    os.symlink('/nowhere/absent.png', 'frames/0001.png')
    contains(ok('-q', '-o', 'out', 'frames', code=75).stderr, '0001.png')


@case
def a_file_that_lists_frames_and_shows_none_says_so(folder):
    drive('whole.mp4')
    ffmpeg('-ss', '2.3', '-i', 'whole.mp4', '-t', '0.04', '-c', 'copy', 'cut.mp4')
    data = bytearray(pathlib.Path('cut.mp4').read_bytes())
    at = data.index(b'elst') + 12  # one edit of no length, which begins behind the last frame
    data[at:at + 8] = struct.pack('>Ii', 40, 1 << 30)
    pathlib.Path('cut.mp4').write_bytes(data)
    contains(ok('-q', '-o', 'out', 'cut.mp4', code=1).stderr, ', of which its edit list shows none')


@case
def a_recorder_that_is_not_there_or_does_not_load_says_why(folder):
    video('clip.mp4', frames=3)
    os.makedirs('bin')
    build = pathlib.Path(os.environ['TERRAINSEG_BUILD'])
    shutil.copy(PROCESS, 'bin/terrainseg-process')
    shutil.copy(build / 'gst/libgstterrainseg.so', 'bin')
    environment = dict(os.environ, GST_PLUGIN_PATH=str(folder / 'bin'), GST_REGISTRY=str(folder / 'registry'))

    def said():
        return subprocess.run(['bin/terrainseg-process', '-o', 'out', '--outputs', 'mcap', 'clip.mp4'], env=environment,
                              capture_output=True, text=True, check=False)

    missing = said()
    equal(missing.returncode, 3, missing.stderr)
    contains(missing.stderr, 'bin/libgstterrainmcap.so is not there')
    pathlib.Path('bin/libgstterrainmcap.so').write_text('no library')
    contains(said().stderr, 'libgstterrainmcap.so is there and does not load (')


@case
def a_bonnet_is_noticed(folder):
    box = 'drawbox=y=ih*0.8:h=ih*0.2:color=gray:t=fill'
    for name, size, extra in (('bonnet', '320x240', ('-vf', box)), ('ten', '320x240', ('-vf', box, '-pix_fmt', 'yuv420p10le')),
                              ('plain', '320x240', ()), ('still', '320x240', ('-vf', 'select=eq(n\\,0),loop=80:1,setpts=N/24/TB')),
                              ('short', '320x240', ('-vf', box))):
        video(f'{name}.mp4', frames=6 if name == 'short' else 72, size=size, extra=extra)
        result = ok('-o', 'out', f'{name}.mp4')
        rows = json.load(open(f'out/{name}.summary.json'))['still_rows']
        if name in ('bonnet', 'ten'):
            assert 40 <= rows <= 48, (name, rows)
            contains(result.stderr, f'--set window-bottom={rows}')
            # What it says to try, helps.
            result = ok('-o', 'out', '--set', f'window-bottom={rows}', f'{name}.mp4')
        equal((json.load(open(f'out/{name}.summary.json'))['still_rows'], told_by(result)), (0, ''), name)


@case
def a_wrong_rectangle_is_answered_with_a_right_one(folder):
    video('drive.mp4', frames=3)
    refused = ok('-o', 'out', '--set', 'ignore-regions=1,2,3', 'drive.mp4', code=2)
    contains(refused.stderr, 'as <<x,y,width,height>,<x,y,width,height>>')
    ok('-q', '-o', 'out', '--set', 'ignore-regions=<<0,0,9,9>,<9,9,9,9>>', 'drive.mp4')


@case
def what_the_filter_warns_of_is_told(folder):
    def warnings(name):
        return json.load(open(f'out/{name}.summary.json'))['warnings']
    video('drive.mp4')
    result = ok('-o', 'out', '--set', 'threshold=1', '--set', 'window-bottom=5000', 'drive.mp4')
    told = [line for line in result.stderr.splitlines() if line.startswith('terrainseg-process: drive.mp4: warning: ')]
    equal((len(told), [line.split('warning: ', 1)[1] for line in told]), (2, warnings('drive')), result.stderr)
    contains(result.stderr, 'threshold')
    contains(result.stderr, 'training window')
    # Where nothing is to be told nothing is, and quiet is quiet.
    result = ok('-q', '-o', 'out', '--set', 'window-bottom=5000', 'drive.mp4')
    equal((result.stderr, len(warnings('drive'))), ('', 1))
    result = ok('-o', 'out', 'drive.mp4')
    equal((told_by(result), warnings('drive')), ('', []))


@case
def the_filters_own_time_is_told(folder):
    video('clip.mp4', frames=30, size='160x120')
    line = ok('-o', 'out', 'clip.mp4').stdout
    own = json.load(open('out/clip.summary.json'))['filter_milliseconds']
    assert 0 < own < 1000, own
    contains(line, f'filter {own:.2f} ms')


@case
def ten_bit_grey_and_interlaced_input(folder):
    for name, extra in (('ten.mkv', ('-pix_fmt', 'yuv420p10le', '-c:v', 'ffv1')),
                        ('h264ten.mp4', ('-pix_fmt', 'yuv420p10le')),
                        ('grey.mkv', ('-pix_fmt', 'gray', '-c:v', 'ffv1')),
                        ('rgb.mkv', ('-pix_fmt', 'bgr0', '-c:v', 'ffv1')),
                        ('four22.mkv', ('-pix_fmt', 'yuv422p', '-c:v', 'ffv1')),
                        ('interlaced.mpg', ('-c:v', 'mpeg2video', '-flags', '+ildct+ilme', '-top', '1', '-vf',
                                            'setfield=tff', '-r', '25')),
                        ('old.avi', ('-c:v', 'mpeg4')),
                        ('web.webm', ('-c:v', 'libvpx', '-deadline', 'realtime'))):
        video(name, frames=10, size='96x64', rate=25, extra=extra)
        ok('-q', '-o', 'out', name)
        check_outputs(f'out/{pathlib.Path(name).stem}', 10, (96, 64))


@case
def a_truncated_file_is_kept_in_part_and_the_rest_goes_on(folder):
    video('cut.mp4', frames=120, size='160x120', extra=('-movflags', '+faststart'))
    whole = pathlib.Path('cut.mp4').read_bytes()
    pathlib.Path('cut.mp4').write_bytes(whole[:len(whole) * 6 // 10])
    video('good.mp4', frames=5)
    result = ok('-o', 'out', 'cut.mp4', 'good.mp4', code=1)
    check_outputs('out/good', 5, (64, 48))
    frames = json.load(open('out/cut.partial.summary.json'))['frames']
    assert 20 < frames < 110, frames
    record = check_outputs('out/cut', frames, (160, 120), partial=True)
    contains(record['problem'], 'cut off')
    contains(result.stderr, 'cut.mp4')
    contains(result.stderr, f'of {len(whole)} bytes')
    contains(result.stderr, f'what could be decoded, {frames} frames, is kept as cut.partial.*')
    contains(result.stdout, 'PARTIAL')
    equal([name for name in left('out') if name.startswith('cut') and 'partial' not in name], [], 'looks whole')
    # Repaired, it is done again and the partial files go.
    pathlib.Path('cut.mp4').write_bytes(whole)
    result = ok('-o', 'out', '--resume', 'cut.mp4', 'good.mp4')
    contains(result.stdout, 'good.mp4: already complete')
    equal(left('out'), outputs_of('cut', 'good'), 'after the repair')


@case
def truncated_in_other_containers(folder):
    for name, extra in (('cut.avi', ('-c:v', 'mpeg4')), ('cut.mkv', ())):
        video(name, frames=60, size='160x120', extra=extra)
        whole = pathlib.Path(name).read_bytes()
        pathlib.Path(name).write_bytes(whole[:len(whole) // 2])
        out = f'out-{name}'
        contains(ok('-o', out, name, code=1).stderr, 'cut off')
        frames = json.load(open(f'{out}/cut.partial.summary.json'))['frames']
        check_outputs(f'{out}/cut', frames, (160, 120), partial=True)


@case
def a_file_without_its_index_fails_by_name(folder):
    video('late.mp4', frames=60, size='160x120')  # the index is at the end
    whole = pathlib.Path('late.mp4').read_bytes()
    pathlib.Path('late.mp4').write_bytes(whole[:len(whole) // 2])
    contains(ok('-o', 'out', 'late.mp4', code=1).stderr, 'late.mp4: the file is cut off')
    # Wherever it is cut: the demuxer says that nothing is there, or stops without a word.
    for size in (20, 40, 100, 1000, 5000, 9000, len(whole) - 1):
        pathlib.Path('late.mp4').write_bytes(whole[:size])
        begin = time.monotonic()
        contains(ok('-o', 'out', 'late.mp4', code=1).stderr, 'late.mp4: ')
        assert time.monotonic() - begin < 20, f'{size} bytes took too long'
    equal(left('out'), [], 'nothing was kept')


@case
def a_damaged_image_is_named(folder):
    images(folder / 'frames', 8)
    data = pathlib.Path('frames/0005.png').read_bytes()
    pathlib.Path('frames/0005.png').write_bytes(data[:len(data) // 3])
    result = ok('-o', 'out', 'frames', code=1)
    contains(result.stderr, '0005.png')
    check_outputs('out/frames', 5, (64, 48), partial=True)


@case
def pictures_that_are_cut_off_or_lost_are_not_whole(folder):
    """A decoder of JPEG fills what is missing with grey, and says nothing."""
    images(folder / 'frames', 5, suffix='jpg')
    for name in '0001.jpg', '0003.jpg':
        data = pathlib.Path('frames', name).read_bytes()
        pathlib.Path('frames', name).write_bytes(data[:len(data) // 2])
    contains(ok('-q', '-o', 'out', 'frames', code=1).stderr, 'frames/0001.jpg: the picture is truncated')
    check_outputs('out/frames', 5, (64, 48), partial=True)
    video('drive.avi', frames=8, extra=('-c:v', 'mjpeg'))
    whole = pathlib.Path('drive.avi').read_bytes()
    for number in 0, 7:
        data, at = bytearray(whole), 0
        for _ in range(number + 1):
            at = data.index(b'\xff\xd8\xff', at + 1)
        data[at:at + 400] = b'\xa8\x0a' * 200
        pathlib.Path('bad.avi').write_bytes(data)
        shutil.rmtree('out')
        ok('-q', '-o', 'out', '--outputs', 'json', 'bad.avi', code=1)
        equal(len(lines_of('out/bad.partial.jsonl')), 7, f'without frame {number}')


@case
def an_image_of_another_type_is_named(folder):
    images(folder / 'frames', 6)
    pathlib.Path('frames/0004.png').write_text('not an image at all')
    result = ok('-o', 'out', 'frames', code=1)
    contains(result.stderr, '0004.png: not an image')
    check_outputs('out/frames', 4, (64, 48), partial=True)
    pathlib.Path('frames/0002.png').write_bytes(b'')
    contains(ok('-o', 'out', 'frames', code=1).stderr, '0002.png: the file is empty')


@case
def noise_in_the_middle_of_a_file(folder):
    video('noisy.mp4', frames=90, size='160x120', extra=('-movflags', '+faststart', '-bf', '0'))
    data = bytearray(pathlib.Path('noisy.mp4').read_bytes())
    for index in range(len(data) // 2, len(data) // 2 + 3000):
        data[index] = index * 31 % 251
    pathlib.Path('noisy.mp4').write_bytes(data)
    video('good.mp4', frames=3)
    result = run('-o', 'out', 'noisy.mp4', 'good.mp4')
    equal(result.returncode, 1, f'exit code ({result.stderr}{result.stdout})')
    contains(result.stderr, 'noisy.mp4: ')
    frames = json.load(open('out/noisy.partial.summary.json'))['frames']
    assert frames > 30, frames
    check_outputs('out/noisy', frames, (160, 120), partial=True)
    check_outputs('out/good', 3, (64, 48))


@case
def what_is_no_video_is_named_with_its_cause(folder):
    pathlib.Path('text.mp4').write_text('this is a text and not a video\n' * 50)
    pathlib.Path('zeros.mp4').write_bytes(bytes(5000))
    pathlib.Path('empty.mp4').write_bytes(b'')
    ffmpeg('-f', 'lavfi', '-i', 'sine=duration=0.3', 'sound.m4a')
    os.mkdir('hollow')
    video('good.mp4', frames=3)
    names = ['text.mp4', 'zeros.mp4', 'empty.mp4', 'sound.m4a', 'hollow', 'absent.mp4', 'no/%03d.png']
    result = ok('-o', 'out', *names, 'good.mp4', code=75)  # of all these the absent ones may come
    lines = result.stderr.splitlines()
    for name in names:
        assert sum(f': {name}: ' in line for line in lines) == 1, (name, result.stderr)
    contains(result.stderr, 'sound.m4a: there is no video in it, only audio/')
    contains(result.stderr, 'absent.mp4: there is no such file')
    contains(result.stderr, 'hollow: there is no video and no image')
    equal(left('out'), outputs_of('good'), 'outputs')
    ok('-q', '-o', 'out', 'text.mp4', 'sound.m4a', 'hollow', code=1)


def without_plugins(folder, *names):
    """An environment in which these files of GStreamer are not installed."""
    system = pathlib.Path(subprocess.run(['pkg-config', '--variable=pluginsdir', 'gstreamer-1.0'], capture_output=True,
                                         text=True, check=True).stdout.strip())
    os.mkdir('plugins')
    for plugin in system.glob('*.so'):
        if plugin.name not in names:
            os.symlink(plugin, f'plugins/{plugin.name}')
    return dict(os.environ, GST_PLUGIN_SYSTEM_PATH=str(folder / 'plugins'), GST_REGISTRY=str(folder / 'registry'))


@case
def a_codec_that_nobody_decodes_is_named_and_nothing_is_to_be_installed(folder):
    video('clip.avi', frames=3, extra=('-c:v', 'mjpeg', '-pix_fmt', 'yuvj420p'))
    data = pathlib.Path('clip.avi').read_bytes()
    assert data.count(b'MJPG') == 2, 'once in each header'
    pathlib.Path('odd.avi').write_bytes(data.replace(b'MJPG', b'QQ8Z'))
    video('clip.mp4', frames=3)
    pathlib.Path('odd.mp4').write_bytes(pathlib.Path('clip.mp4').read_bytes().replace(b'avc1', b'QQ8Z'))
    for name in 'odd.avi', 'odd.mp4':
        error = ok('-q', '-o', 'out', name, code=1).stderr
        contains(error, f"{name}: GStreamer does not know the codec 'QQ8Z'")
        contains(error, 'ffmpeg -i INPUT')
        assert 'install gst' not in error, error
    # Where a package that has it is missing, that one is to be installed, and no other.
    video('mpeg4.mp4', frames=3, extra=('-c:v', 'mpeg4'))
    error = ok('-q', '-o', 'out', '--outputs', 'json', 'mpeg4.mp4', code=1, env=without_plugins(folder, 'libgstlibav.so')).stderr
    contains(error, 'decoder is missing; install gstreamer1.0-libav\n')


@case
def an_element_that_gave_up_says_why(folder):
    """Its error message alone is 'Internal data stream error.'"""
    video('screen.flv', frames=3, extra=('-c:v', 'flashsv2', '-pix_fmt', 'bgr24'))
    result = ok('-q', '-o', 'out', 'screen.flv', code=1)
    contains(result.stderr, 'screen.flv: flvdemux gave up: unsupported video codec tag 6; convert it')
    contains(result.stderr, 'ffmpeg -i INPUT')
    equal(len(result.stderr.splitlines()), 1, f'the log is not for the screen: {result.stderr}')
    for wish in ({'GST_DEBUG': 'flvdemux:2'}, ()), ({}, ('--gst-debug=flvdemux:2',)):  # unless somebody asks for it
        contains(ok('-q', '-o', 'out', *wish[1], 'screen.flv', code=1, env=dict(os.environ, **wish[0])).stderr, 'gst_flv_demux')


@case
def exit_codes_tell_never_from_later(folder):
    video('cut.mp4', frames=60, size='160x120', extra=('-movflags', '+faststart'))
    whole = pathlib.Path('cut.mp4').read_bytes()
    pathlib.Path('cut.mp4').write_bytes(whole[:len(whole) // 2])
    os.mkfifo('pipe.mp4')
    ok('-q', '-o', 'out', 'cut.mp4', code=1)
    equal(json.load(open('out/cut.partial.summary.json'))['cause'], 'damaged', 'cause')
    ok('-q', '-o', 'out', 'absent.mp4', code=75)
    ok('-q', '-o', 'out', 'absent.mp4', 'cut.mp4', code=75)
    contains(ok('-q', '-o', 'out', 'pipe.mp4', code=1).stderr, 'pipe.mp4: this is a pipe or a device')
    os.rename('cut.mp4', 'denied.mp4')
    if os.getuid() == 0:
        contains(ok('-q', '-o', '/dev/full', 'denied.mp4', code=4).stderr, '/dev/full')
    else:
        os.chmod('denied.mp4', 0)
        ok('-q', '-o', 'out', 'denied.mp4', code=75)


@case
def a_run_has_a_tally(folder):
    os.mkdir('rec')
    for index in range(3):
        video(f'rec/v{index}.mp4', frames=4)
    pathlib.Path('rec/bad.mp4').write_bytes(bytes(3000))
    pathlib.Path('rec/notes.txt').write_text('text')
    ok('-q', '-o', 'out', 'rec/v0.mp4')
    result = ok('-o', 'out', '--resume', 'rec', 'absent.mp4', code=75)
    line = result.stdout.splitlines()[-1]
    contains(line, '5 inputs: 2 complete, 1 skipped, 2 failed (1 may succeed when tried again); 8 frames in 0:')
    contains(result.stderr, 'rec: left out 1 member')
    contains(result.stderr, 'notes.txt')


def manifest(path):
    head, *lines = map(json.loads, open(path))
    return head, {line['input']: line for line in lines}


def a_fleet(folder, count=6):
    os.mkdir('rec')
    os.mkdir('rec/sub')
    names = [f'rec/{"sub/" if index % 2 else ""}v{index}.mp4' for index in range(count)]
    for index, name in enumerate(names):
        video(name, frames=3 + index)
    pathlib.Path('list').write_text(''.join(f'{name}\n' for name in names))
    return names


@case
def shards_together_make_what_one_run_makes(folder):
    names = a_fleet(folder)
    ok('-q', '-o', 'one', '--inputs-from', 'list')
    for index in range(3):
        ok('-q', '-o', 'all', '--inputs-from', 'list', '--shard', 'auto', '--manifest', f'm{index}.jsonl',
           env=dict(os.environ, JOB_COMPLETION_INDEX=str(index), TERRAINSEG_SHARD_COUNT='3'))
    expected = {str(path.relative_to('one')) for path in pathlib.Path('one').rglob('*') if path.is_file()}
    equal({str(path.relative_to('all')) for path in pathlib.Path('all').rglob('*') if path.is_file()}, expected, 'names')
    assert 'rec/sub/v1.masks.mkv' in expected, expected
    for name in expected:
        if name.endswith(('.jsonl', '.csv')):
            equal(pathlib.Path('all', name).read_bytes(), pathlib.Path('one', name).read_bytes(), name)
        elif name.endswith('.mkv'):
            equal(raw(f'all/{name}', 'gray'), raw(f'one/{name}', 'gray'), name)
    lines = {}
    for index in range(3):
        head, some = manifest(f'm{index}.jsonl')
        equal((head['shard'], head['shards'], head['inputs']), (index + 1, 3, len(some)), 'head')
        assert not set(lines) & set(some), 'an input in two shards'
        lines.update(some)
    equal(sorted(lines), sorted(names), 'inputs in the manifests')
    for name, line in lines.items():
        equal(line['status'], 'complete', name)
        for output in line['outputs'].values():
            data = pathlib.Path('all', output['file']).read_bytes()
            equal((output['bytes'], output['sha256']), (len(data), hashlib.sha256(data).hexdigest()), output['file'])
    # The list on standard input, ended by NUL, and with what a run from a folder is called.
    listed = subprocess.run([PROCESS, '-o', 'all', '--resume', '--inputs-from', '-'], input='\0'.join(names), text=True,
                            capture_output=True, timeout=100)
    equal((listed.returncode, listed.stdout.count('already complete, skipped')), (0, len(names)), listed.stderr)
    contains(ok('--inputs-from', os.devnull, code=2).stderr, 'the list is empty')
    contains(ok('--inputs-from', 'absent', code=2).stderr, 'cannot read absent')
    contains(ok('--inputs-from', 'list', '--shard', '7/3', code=2).stderr, '7/3')


@case
def a_check_names_what_is_missing_or_damaged(folder):
    names = a_fleet(folder, 4)
    video(names[3], frames=60, extra=('-movflags', '+faststart'))
    whole = pathlib.Path(names[3]).read_bytes()
    pathlib.Path(names[3]).write_bytes(whole[:len(whole) // 2])
    shards = []
    for index in 1, 2:
        code = run('-q', '-o', 'out', '--inputs-from', 'list', '--shard', f'{index}/2', '--manifest', f'm{index}').returncode
        assert code in (0, 1), code
        shards.append(pathlib.Path(f'm{index}').read_text())
    pathlib.Path('all').write_text(''.join(shards))
    result = ok('--check', 'all', '--inputs-from', 'list', code=1)
    contains(result.stdout, '3 complete, 1 permanently damaged, 0 to try again')
    contains(result.stderr, f'{names[3]}: partial: the file is cut off')
    pathlib.Path('half').write_text(shards[0])
    contains(ok('--check', 'half', code=75).stderr, 'shard 2/2 has no manifest')
    os.truncate('out/rec/v0.csv', 10)
    os.remove('out/rec/sub/v1.jsonl')
    path = pathlib.Path('out/rec/v2.masks.mkv')
    path.write_bytes(path.read_bytes()[:-1] + b'?')
    result = ok('--check', 'all', code=75)
    for text in ('v0.csv has 10 bytes', 'v1.jsonl is missing', 'v2.masks.mkv is not the file that was written'):
        contains(result.stderr, text)
    contains(result.stdout, '0 complete, 1 permanently damaged, 3 to try again')
    with open('list', 'a') as file:
        file.write('rec/new.mp4\n')
    contains(ok('--check', 'all', '--inputs-from', 'list', code=75).stderr, 'rec/new.mp4: has no line')
    os.rename('out', 'moved')
    contains(ok('--check', 'all', '-o', 'moved', code=75).stderr, 'moved/rec/v0.csv has 10 bytes')
    checked = subprocess.run([PROCESS, '--check', '-'], input=shards[0][:-20], text=True, capture_output=True)
    equal(checked.returncode, 75, checked.stderr)
    contains(checked.stderr, 'of the manifest cannot be read')
    contains(ok('--check', 'list', code=2).stderr, 'not a manifest')
    nothing = subprocess.run([PROCESS, '--check', '-'], stdin=subprocess.DEVNULL, text=True, capture_output=True)
    equal(nothing.returncode, 2)
    contains(nothing.stderr, 'what standard input gave is not a manifest')
    contains(ok('--check', 'absent', code=2).stderr, 'No such file')


@case
def a_manifest_replaces_no_other_file(folder):
    video('clip.mp4', frames=3)
    for name in 'clip.mp4', './clip.mp4', 'out/clip.csv':
        contains(ok('-q', '-o', 'out', '--manifest', name, 'clip.mp4', code=2).stderr, 'the manifest')
    pathlib.Path('notes').write_text('mine\n')
    contains(ok('-q', '-o', 'out', '--manifest', 'notes', 'clip.mp4', code=2).stderr, 'would replace a file')
    assert not os.path.exists('out')
    for _ in range(2):
        ok('-q', '-o', 'out', '--manifest', 'm', '--resume', 'clip.mp4')
    equal(manifest('m')[1]['clip.mp4']['status'], 'skipped', 'the second time')
    ok('-q', '--check', 'm')


def workers_of(process):
    """The processes that decode for it."""
    return [child for task in os.listdir(f'/proc/{process.pid}/task')
            for child in map(int, pathlib.Path(f'/proc/{process.pid}/task/{task}/children').read_text().split())]


@case
def threads_are_bounded(folder):
    video('clip.mp4', frames=300, size='320x240')

    def most_threads(*arguments):
        process = subprocess.Popen([PROCESS, '-q', '-o', 'out', *arguments, 'clip.mp4'])
        most = 0
        while process.poll() is None:
            with contextlib.suppress(OSError):
                for worker in workers_of(process):
                    most = max(most, len(os.listdir(f'/proc/{worker}/task')))
            time.sleep(0.01)
        equal(process.returncode, 0, 'exit code')
        return most

    few, many = most_threads('--threads', '1'), most_threads('--threads', '8')
    assert few + 10 < many, (few, many)
    assert few <= 14, few


@case
def a_moving_gif_ends(folder):
    ffmpeg('-f', 'lavfi', '-i', 'testsrc2=size=64x48:rate=10', '-frames:v', 12, 'loop.gif')
    begin = time.monotonic()
    ok('-q', '-o', 'out', 'loop.gif')
    assert time.monotonic() - begin < 20, 'it waited'
    check_outputs('out/loop', 12, (64, 48))
    data = pathlib.Path('loop.gif').read_bytes()
    # Its demuxer takes the end for nothing yet, and would ask for more for ever, with a lock that encoders want.
    for length in (10, 50, len(data) * 2 // 3, len(data) - 1):
        pathlib.Path('cut.gif').write_bytes(data[:length])
        begin = time.monotonic()
        error = ok('-q', '-o', 'cut', '--stall-timeout', 60, 'cut.gif', code=1).stderr
        contains(error, 'cut.gif: the file is cut off: its end mark is missing')
        assert time.monotonic() - begin < 30 and 'stall' not in error, (length, error)
    contains(error, '12 frames, is kept')
    equal(json.loads(pathlib.Path('cut/cut.partial.summary.json').read_text())['frames'], 12, 'frames')
    # One run in forty never ended.
    for _ in range(8):
        runs = [subprocess.Popen([PROCESS, '-q', '-o', f'cut{i}', 'cut.gif'], stderr=subprocess.DEVNULL) for i in range(6)]
        for each in runs:
            try:
                equal(each.wait(timeout=30), 1, 'exit code')
            finally:
                each.kill()


@case
def a_slow_disk_leaves_no_frame_of_a_gif_out(folder):
    """It has been read to its end long before its last frame is written."""
    if 'TERRAINSEG_FAULTS' not in os.environ:
        raise Skip('a sanitizer and a preloaded library do not go together')
    ffmpeg('-f', 'lavfi', '-i', 'color=gray:size=64x48:rate=10', '-frames:v', 60, 'slow.gif')  # one read
    slow = dict(os.environ, LD_PRELOAD=os.environ['TERRAINSEG_FAULTS'], FAULT='wait:8')
    ok('-q', '-o', 'out', '--outputs', 'json', 'slow.gif', env=slow)
    equal(json.loads(pathlib.Path('out/slow.summary.json').read_text())['frames'], 60, 'frames')


@case
def what_gives_no_frame_is_given_up(folder):
    begin = time.monotonic()
    port = free_port()
    result = ok('-q', '-o', 'out', '--stall-timeout', 2, f'udp://127.0.0.1:{port}', code=75)
    contains(result.stderr, 'no frame came for 2 s (--stall-timeout)')
    assert 1.5 < time.monotonic() - begin < 15, 'the time'
    equal(left('out'), [], 'outputs')


def with_fault(fault, out, *arguments):
    environment = dict(os.environ, LD_PRELOAD=os.environ['TERRAINSEG_FAULTS'], FAULT=fault)
    return run('-q', '-o', out, '--outputs', 'json,csv', '--manifest', f'{out}.manifest', *arguments, 'clip.mp4', env=environment)


def calls_that_matter(folder):
    """Makes clip.mp4 and what it becomes in whole/; gives the number of writes, syncs and renames of that."""
    if 'TERRAINSEG_FAULTS' not in os.environ:
        raise Skip('a sanitizer and a preloaded library do not go together')
    video('clip.mp4', frames=3)
    equal(with_fault(f'count:{folder}/count', 'whole').returncode, 0, 'without a fault')
    count = int(pathlib.Path('count').read_text())
    # Two outputs, two records and the manifest are each written, synced and renamed.
    assert count >= 15, count
    return count


def check_whole_or_part(out, what):
    """Whatever has its own name is whole, and a record that says complete tells the truth."""
    names = left(out) if os.path.exists(out) else []
    for name in names:
        if name in ('clip.jsonl', 'clip.csv'):
            equal(pathlib.Path(out, name).read_bytes(), pathlib.Path('whole', name).read_bytes(), f'{what}: {name}')
        elif name == 'clip.summary.json':
            if json.load(open(f'{out}/{name}'))['complete']:
                assert {'clip.jsonl', 'clip.csv'} <= set(names), (what, names)
        else:
            assert name.endswith('.part'), (what, name)
    if os.path.exists(f'{out}.manifest'):
        head, lines = manifest(f'{out}.manifest')
        equal(len(lines), head['inputs'], f'{what}: the manifest')


@case
def a_power_cut_at_any_moment_leaves_whole_files_or_part_files(folder):
    for number in range(1, calls_that_matter(folder) + 1):
        for moment in ('before', 'after') if number == 1 else ('after',):  # before the next is after this one
            out = f'{moment}{number}'
            equal(with_fault(f'{moment}:{number}', out).returncode, -signal.SIGKILL, out)
            check_whole_or_part(out, out)
            ok('-q', '-o', out, '--outputs', 'json,csv', '--manifest', f'{out}.manifest', '--resume', 'clip.mp4')
            check_whole_or_part(out, f'{out}, run again')
            assert json.load(open(f'{out}/clip.summary.json'))['complete'], out
            ok('-q', '--check', f'{out}.manifest')


@case
def a_failing_disk_at_any_moment_is_told_and_may_be_tried_again(folder):
    count = calls_that_matter(folder)
    for number in range(1, count + 1):
        error = errno.ENOSPC if number % 2 else errno.EIO
        out = f'error{number}'
        result = with_fault(f'{int(error)}:{number}', out)
        equal(result.returncode, 75, f'{out}: {result.stderr}')
        contains(result.stderr, os.strerror(error))
        check_whole_or_part(out, out)
        ok('-q', '-o', out, '--outputs', 'json,csv', '--resume', 'clip.mp4')
        check_whole_or_part(out, f'{out}, run again')


@case
def a_crashing_decoder_takes_one_input_with_it(folder):
    if 'TERRAINSEG_FAULTS' not in os.environ:
        raise Skip('a sanitizer and a preloaded library do not go together')
    for name in 'first', 'bad', 'last':
        video(f'{name}.mp4', frames=4)
    images(folder / 'bad', frames=3)
    names = ('first.mp4', 'bad.mp4', 'last.mp4')

    def crashing(fault, *arguments, code):
        environment = dict(os.environ, LD_PRELOAD=os.environ['TERRAINSEG_FAULTS'], FAULT=fault)
        return ok('-o', 'out', '--manifest', 'm', '--outputs', 'annotated,masks,json,csv,mcap', *arguments, code=code, env=environment)

    good = outputs_of('first', 'last')
    for jobs, again in (1, ()), (2, ()), (1, ('--resume',)):  # the crash comes again, and takes nothing with it
        result = crashing('crash:/bad.', *again, '--jobs', jobs, *names, code=1)
        contains(result.stderr, 'bad.mp4: the decoder crashed (signal 11, Segmentation fault)')
        contains(result.stderr, 'ffmpeg -i')
        contains(result.stdout, '3 inputs: 0 complete, 2 skipped, 1 failed' if again else '3 inputs: 2 complete, 1 failed')
        equal([name for name in left('out') if not name.endswith('.bag')], good, 'outputs')
        lines = manifest('m')[1]
        equal({name: lines[name]['status'] for name in names},
              {'first.mp4': 'skipped' if again else 'complete', 'bad.mp4': 'failed', 'last.mp4': 'skipped' if again else 'complete'}, 'manifest')
        equal((lines['bad.mp4']['cause'], lines['bad.mp4']['try_again']), ('crashed', False), 'cause')
        assert lines['bad.mp4']['fingerprint'], 'whose it is'
        assert not pathlib.Path('out/bad.bag').exists(), 'the folder of a recording'
    contains(crashing('crash:/bad.', 'bad', code=1).stderr, 'the decoder crashed')  # images
    # What an earlier input has broken in its process is no fault of this one.
    crashing('crash-once:/bad.', *names, code=0)
    equal([name for name in left('out') if not name.endswith('.bag')], outputs_of('first', 'bad', 'last'), 'outputs')
    # Ended from outside: for want of memory, which may pass.
    shutil.rmtree('out')
    result = crashing('kill:/bad.', *names, code=75)
    contains(result.stderr, '(signal 9, Killed)')
    equal(manifest('m')[1]['bad.mp4']['cause'], 'resources', 'cause')
    equal([name for name in left('out') if not name.endswith('.bag')], good, 'outputs')


@case
def an_element_that_never_stops_takes_one_input_with_it(folder):
    """Its thread hangs in a call, so the pipeline that waits for it never stops."""
    if 'TERRAINSEG_FAULTS' not in os.environ:
        raise Skip('a sanitizer and a preloaded library do not go together')
    names = 'first.mp4', 'bad.mp4', 'last.mp4'
    for name in names:
        video(name, frames=4)
    hanging = dict(os.environ, LD_PRELOAD=os.environ['TERRAINSEG_FAULTS'], FAULT='hang:/bad.')
    arguments = '-o', 'out', '--manifest', 'm', '--outputs', 'annotated,masks,json,csv,mcap'
    begin = time.monotonic()
    result = ok(*arguments, '--stall-timeout', 2, *names, code=1, env=hanging)
    assert time.monotonic() - begin < 30, 'the time'
    contains(result.stderr, 'bad.mp4: an element of GStreamer did not start or stop in the time of --stall-timeout')
    equal(manifest('m')[1]['bad.mp4']['cause'], 'stalled', 'cause')
    good = [name for name in outputs_of('first', 'last') if not name.endswith('.bag')]
    equal([name for name in left('out') if not name.endswith('.bag')], good, 'outputs')
    # A user who stops it need not wait for that time.
    with subprocess.Popen([PROCESS, *arguments, '--stall-timeout', '600', 'bad.mp4'], env=hanging, stderr=subprocess.PIPE) as run:
        time.sleep(3)
        begin = time.monotonic()
        run.terminate()
        equal(run.wait(30), 75, 'exit code')
        assert time.monotonic() - begin < 20, 'the time'
    equal([name for name in left('out') if not name.endswith('.bag')], good, 'outputs')


@case
def a_stopped_run_goes_on(folder):
    """Ctrl-Z for as long as --stall-timeout, while a write takes 4 seconds: the time does not count."""
    if 'TERRAINSEG_FAULTS' not in os.environ:
        raise Skip('a sanitizer and a preloaded library do not go together')
    video('drive.mp4', frames=300)
    slow = dict(os.environ, LD_PRELOAD=os.environ['TERRAINSEG_FAULTS'], FAULT='wait:8')
    with subprocess.Popen([PROCESS, '-q', '-o', 'out', '--outputs', 'json', '--stall-timeout', '3', 'drive.mp4'], env=slow,
                          stderr=subprocess.PIPE, text=True, start_new_session=True) as run:
        before = 0
        while run.poll() is None:  # until the write waits
            written = sum(path.stat().st_size for path in folder.glob('out/*.part'))
            if written and written == before:
                break
            before = written
            time.sleep(0.5)
        os.killpg(run.pid, signal.SIGSTOP)
        time.sleep(3)
        os.killpg(run.pid, signal.SIGCONT)
        errors = run.communicate(timeout=60)[1]
        equal(run.returncode, 0, errors)
    equal(json.loads((folder / 'out/drive.summary.json').read_text())['frames'], 300, 'frames')


@case
def other_inputs_and_empty_files_are_named(folder):
    (folder / 'text.mp4').write_text('hello\n')
    (folder / 'empty.mp4').write_text('')
    for name, said in (('text.mp4', 'its type is unknown: it is not a video, or its beginning is damaged'), ('empty.mp4', 'it is empty'),
                       ('foo://bar', 'no element of GStreamer reads foo:// addresses'), ('-', 'standard input cannot be read')):
        contains(ok('-q', '-o', 'out', name, code=1).stderr, f'{name}: {said}')


SAVE = """import gi, sys
gi.require_version('Gst', '1.0')
from gi.repository import Gst
Gst.init(None)
p = Gst.parse_launch('terrainscenesrc num-buffers=12 seed=' + sys.argv[2] + ' ! video/x-raw,format=I420,width=96,height=64 ! '
                     'terrainseg name=f ! fakesink')
p.set_state(Gst.State.PLAYING)
p.get_bus().timed_pop_filtered(20 * Gst.SECOND, Gst.MessageType.EOS | Gst.MessageType.ERROR)
saved = p.get_by_name('f').emit('save-model', sys.argv[1])
p.set_state(Gst.State.NULL)
sys.exit(0 if saved else 3)
"""


def save(path, seed, fault=None):
    environment = dict(os.environ, **({'LD_PRELOAD': os.environ['TERRAINSEG_FAULTS'], 'FAULT': fault} if fault else {}))
    return subprocess.run(['/usr/bin/python3', '-c', SAVE, path, str(seed)], env=environment, stderr=subprocess.DEVNULL).returncode


@case
def a_model_that_is_saved_is_whole_after_any_fault(folder):
    if 'TERRAINSEG_FAULTS' not in os.environ:
        raise Skip('a sanitizer and a preloaded library do not go together')
    equal((save('old', 1), save('new', 2, f'count:{folder}/count')), (0, 0), 'without a fault')
    old, new = pathlib.Path('old').read_bytes(), pathlib.Path('new').read_bytes()
    assert old != new, 'two terrains'
    count = int(pathlib.Path('count').read_text())
    assert count >= 3, count  # write, fsync, rename
    for number in range(1, count + 1):
        for fault, code in (('before', -signal.SIGKILL), ('after', -signal.SIGKILL), (int(errno.ENOSPC), 3), (int(errno.EIO), 3)):
            name = f'{fault}{number}'
            os.mkdir(name)
            pathlib.Path(name, 'terrain').write_bytes(old)
            equal(save(f'{name}/terrain', 2, f'{fault}:{number}'), code, name)
            done = fault == 'after' and number == count
            equal(pathlib.Path(name, 'terrain').read_bytes(), new if done else old, name)
            others = [each for each in os.listdir(name) if each != 'terrain']
            assert all(each.endswith('.part') for each in others), (name, others)
            assert not others or code < 0, f'{name}: what failed leaves nothing behind'


def free_port():
    with socket.socket(type=socket.SOCK_DGRAM) as nobody:
        nobody.bind(('127.0.0.1', 0))
        return nobody.getsockname()[1]


def start_long_run(out, size='160x120'):
    video('long.mp4', frames=2000, size=size)
    process = subprocess.Popen([PROCESS, '-o', out, 'long.mp4'], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    deadline = time.monotonic() + 60
    part = pathlib.Path(out, 'long.csv.part')
    while not (part.exists() and part.stat().st_size > 0):
        assert process.poll() is None and time.monotonic() < deadline, 'it never began'
        time.sleep(0.01)
    return process


@case
def killed_mid_run_leaves_nothing_that_looks_whole(folder):
    process = start_long_run('out')
    process.kill()
    process.communicate()
    equal(left('out'), sorted(f'long.{kind}.part' for kind in (*KINDS, 'summary.json')), 'after kill -9')
    ok('-q', '-o', 'out', '--resume', 'long.mp4')
    equal(left('out'), outputs_of('long'), 'after the second run')
    equal(json.load(open('out/long.summary.json'))['frames'], 2000, 'frames')


@case
def interrupted_leaves_nothing_unfinished(folder):
    for number in signal.SIGINT, signal.SIGTERM:
        process = start_long_run('out')
        process.send_signal(number)
        _, text = process.communicate(timeout=30)
        equal(process.returncode, 130 if number == signal.SIGINT else 75, 'exit code')
        contains(text.decode(), 'interrupted')
        equal(left('out'), [], 'after the signal')


@case
def ctrl_c_reaches_all_processes_and_counts_once(folder):
    """A terminal gives it to the program and to what decodes for it; a live stream ends its files properly at the first."""
    video('clip.mp4', frames=40)
    stream = subprocess.Popen(['ffmpeg', '-v', 'quiet', '-re', '-stream_loop', '-1', '-i', 'clip.mp4', '-c', 'copy', '-f', 'mpegts',
                               'udp://127.0.0.1:%d?pkt_size=1316' % (port := free_port())])
    try:
        process = subprocess.Popen([PROCESS, '-q', '-o', 'out', f'udp://127.0.0.1:{port}'], stderr=subprocess.PIPE, start_new_session=True)
        deadline = time.monotonic() + 60
        part = pathlib.Path('out').glob
        while not any(path.stat().st_size for path in part('*.masks.mkv.part')):
            assert process.poll() is None and time.monotonic() < deadline, 'it never began'
            time.sleep(0.01)
        os.killpg(process.pid, signal.SIGINT)
        _, text = process.communicate(timeout=30)
        equal(process.returncode, 0, text)
        equal(len(left('out')), 5, left('out'))
    finally:
        stream.kill()
        stream.wait()


@case
def two_runs_never_write_the_same_file(folder):
    first = start_long_run('out', '320x240')
    try:
        result = ok('-o', 'out', 'long.mp4', code=75)
        contains(result.stderr, 'another run is writing it')
    finally:
        first.kill()
        first.communicate()


@case
def resume_skips_only_what_is_whole_and_the_same(folder):
    for name in 'a', 'b':
        video(f'{name}.mp4', frames=4)
    ok('-q', '-o', 'out', 'a.mp4', 'b.mp4')

    def skipped(*arguments):
        return ok('-o', 'out', '--resume', *arguments, 'a.mp4', 'b.mp4').stdout.count('already complete')

    equal(skipped(), 2, 'unchanged')
    equal(skipped('--set', 'caution=4'), 0, 'other settings')
    equal(skipped('--set', 'caution=4'), 2, 'the same settings again')
    os.truncate('out/a.masks.mkv', 100)
    equal(skipped('--set', 'caution=4'), 1, 'an output was cut')
    os.remove('out/b.csv')
    equal(skipped('--set', 'caution=4'), 1, 'an output is gone')
    video('a.mp4', frames=5)
    equal(skipped('--set', 'caution=4'), 1, 'the input changed')
    os.utime('a.mp4')
    equal(skipped('--set', 'caution=4'), 2, 'touched')
    shutil.copyfile('a.mp4', 'staged.mp4')
    equal(ok('-o', 'out', '--resume', '--name', 'a', '--set', 'caution=4', 'staged.mp4').stdout.count('skipped'), 1, 'staged')
    for text in '{"complete": true', '[1, 2]', '{"input": 7}':
        os.rename('out/a.summary.json', 'kept')
        pathlib.Path('out/a.summary.json').write_text(text)
        contains(ok('-o', 'out', '--resume', 'a.mp4', code=2).stderr, 'no record says that it was made from a.mp4')
        os.rename('kept', 'out/a.summary.json')
    equal(skipped('--set', 'caution=4', '--outputs', 'csv'), 0, 'fewer outputs have other settings')


@case
def an_output_folder_that_cannot_be_written(folder):
    video('clip.mp4', frames=3)
    pathlib.Path('file').write_text('')
    for place in ('file/sub', '/proc/terrainseg', 'file'):
        result = ok('-o', place, 'clip.mp4', code=4)
        contains(result.stderr, place)
    os.makedirs('out/clip.masks.mkv')
    contains(ok('-o', 'out', 'clip.mp4', code=2).stderr, 'clip.masks.mkv already exists')
    equal(left('out'), ['clip.masks.mkv'], 'nothing else')


@case
def a_limit_on_file_sizes_fails_for_good_and_leaves_nothing(folder):
    video('clip.mp4', frames=200, size='320x240')

    def small_files():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))

    # EFBIG: the file system, or a limit, has no room for a file of that size, and will have none later.
    result = run('-o', 'out', 'clip.mp4', preexec_fn=small_files)
    equal(result.returncode, 1, result.stderr)
    contains(result.stderr, 'clip.mp4: cannot write out/clip.')
    equal(left('out'), [], 'nothing is kept')


@case
def a_missing_plugin_is_named_with_its_package(folder):
    video('clip.mp4', frames=3)
    environment = without_plugins(folder, 'libgstlibav.so', 'libgstisomp4.so')
    result = ok('-o', 'out', 'clip.mp4', code=3, env=environment)
    contains(result.stderr, "'avenc_ffv1' is missing: install gstreamer1.0-libav")
    contains(result.stderr, "'mp4mux' is missing: install gstreamer1.0-plugins-good")
    assert not os.path.exists('out')


@case
def the_plugin_is_found_without_help(folder):
    video('clip.mp4', frames=3)
    environment = {name: value for name, value in os.environ.items() if not name.startswith('GST_PLUGIN')}
    environment['GST_REGISTRY'] = str(folder / 'registry')
    ok('-q', '-o', 'out', 'clip.mp4', env=environment)
    check_outputs('out/clip', 3, (64, 48))


@case
def an_installation_that_was_moved_finds_its_plugin(folder):
    video('clip.mp4', frames=3)
    build = os.environ['TERRAINSEG_BUILD']
    with installing(build):
        subprocess.run(['meson', 'install', '-C', build, '--no-rebuild', '--destdir', folder / 'moved'],
                       check=True, capture_output=True)
    program = next((folder / 'moved').rglob('bin/terrainseg-process'))
    environment = {name: value for name, value in os.environ.items() if not name.startswith('GST_PLUGIN')}
    environment['GST_REGISTRY'] = str(folder / 'registry')
    subprocess.run([program, '-q', '-o', 'out', 'clip.mp4'], env=environment, check=True, timeout=60)
    check_outputs('out/clip', 3, (64, 48))


@case
def progress_on_a_terminal(folder):
    video('clip.mp4', frames=1500, size='320x240')
    master, slave = pty.openpty()
    process = subprocess.Popen([PROCESS, '-o', 'out', 'clip.mp4'], stdout=subprocess.DEVNULL, stderr=slave)
    os.close(slave)
    text = b''
    while True:
        try:
            if select.select([master], [], [], 60)[0]:
                data = os.read(master, 65536)
                text += data
                if not data:
                    break
        except OSError:  # the other end is closed
            break
    equal(process.wait(60), 0, 'exit code')
    os.close(master)
    text = text.decode()
    assert text.count('\r') > 5, text
    for part in ('[1/1] clip.mp4', ' fps', ' left', '#', ' %'):
        contains(text, part)
    assert text.endswith('\r\x1b[K'), 'the bar stays on the screen'


@case
def quiet_is_quiet(folder):
    video('clip.mp4', frames=3)
    result = ok('-q', '-o', 'out', 'clip.mp4')
    equal(result.stdout + result.stderr, '', 'output')
    contains(ok('-q', '-o', 'out', 'clip.mp4', 'absent.mp4', code=75).stderr, 'absent.mp4')


@case
def a_uri_is_an_input_too(folder):
    video('clip.mp4', frames=3)
    ok('-q', '-o', 'out', (folder / 'clip.mp4').as_uri())
    check_outputs('out/clip', 3, (64, 48))


class Web:
    """A web server with one file; where `path` is None, a port that refuses."""

    def __init__(self, path, code=200):
        self.data = path.read_bytes() if path else b''
        web = self

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_GET(self):
                self.send_response(code)
                self.send_header('Content-Length', str(len(web.data)))
                self.end_headers()
                self.wfile.write(web.data)

            def log_message(self, *_):
                pass

        self.server = http.server.ThreadingHTTPServer(('127.0.0.1', 0), Handler)
        self.address = f'http://127.0.0.1:{self.server.server_port}/clip.mp4'
        if path is None:
            self.server.server_close()

    def __enter__(self):
        if self.data:
            threading.Thread(target=self.server.serve_forever, daemon=True).start()
        return self.address

    def __exit__(self, *_):
        if self.data:
            self.server.shutdown()
            self.server.server_close()


@case
def what_is_not_reached_may_be_tried_again_and_what_is_broken_not(folder):
    video('clip.mp4', frames=30)
    clip = folder / 'clip.mp4'
    noise = folder / 'noise.mp4'
    noise.write_bytes(bytes(range(256)) * 100)
    os.environ.pop('http_proxy', None)
    with Web(clip) as address:
        ok('-q', '-o', 'out', address)
    for name, web, code in ('refused', Web(None), 75), ('not found', Web(clip, code=404), 75), ('no video', Web(noise), 1):
        with web as address:
            contains(ok('-q', '-o', name, address, code=code).stderr, address)


@case
def a_password_in_a_uri_is_in_no_message_and_no_file(folder):
    video('clip.mp4', frames=3)
    clip = folder / 'clip.mp4'
    with Web(clip) as address:
        uri = address.replace('://', '://me:se%40cret@')
        told = ok('-o', 'out', '--outputs', 'json', '--manifest', 'm', uri)
    refused = ok('-o', 'out', '--manifest', 'n', 'rtsp://me:se@cret@127.0.0.1:9/x', uri, code=75)
    contains(refused.stderr, 'rtsp://127.0.0.1:9/x')
    contains(ok('-o', 'out', 'rtsp://me:secret@127.0.0.1:9', code=75).stderr, 'rtsp://127.0.0.1:9')
    texts = [*left('out'), told.stdout, told.stderr, refused.stdout, refused.stderr]
    texts += [path.read_text() for path in (folder / 'm', folder / 'n', *(folder / 'out').iterdir())]
    assert not any('cret' in text for text in texts), texts


def drive(path, *encoder, size='320x180', frames=60, sound=False, filters=()):
    """The renderer's drive, encoded as a camera does: with B-frames unless `encoder` says otherwise, and with sound."""
    width, height = size.split('x')
    source = pathlib.Path(f'drive-{size}-{frames}.y4m')
    if not source.exists():
        subprocess.run(['gst-launch-1.0', '-q', 'terrainscenesrc', f'num-buffers={frames}', '!',
                        f'video/x-raw,format=I420,width={width},height={height},framerate=25/1', '!', 'y4menc', '!',
                        'filesink', f'location={source}'], check=True)
    audio = ('-f', 'lavfi', '-i', f'sine=duration={frames / 25}', '-map', '0:v', '-map', '1:a') if sound else ()
    ffmpeg('-i', source, *audio, *filters, *(encoder or ('-c:v', 'libx264', '-preset', 'veryfast', '-bf', '3')), path)
    return path


H264 = ('-c:v', 'libx264', '-bf', '3', '-g', '12', '-x264-params', 'open-gop=1:b-adapt=0:scenecut=0')
HEVC = ('-c:v', 'libx265', '-x265-params', 'log-level=error:open-gop=1:keyint=12:bframes=3:b-adapt=0:scenecut=0')


def differences(one, other, size):
    """Of each pair of frames that ffmpeg shows: the mean absolute difference of their bytes, in RGB."""
    length = int(size.split('x')[0]) * int(size.split('x')[1]) * 3
    frames = []
    for path in one, other:
        data = subprocess.run(['ffmpeg', '-v', 'fatal', '-i', str(path), '-map', '0:V:0', '-fps_mode', 'passthrough', '-f',
                               'rawvideo', '-pix_fmt', 'rgb24', '-'], capture_output=True, check=True).stdout
        frames.append([data[at:at + length] for at in range(0, len(data), length)])
    equal(len(frames[0]), len(frames[1]), f'frames of {one} and {other}')
    return [sum(abs(a - b) for a, b in zip(x[::61], y[::61])) / len(x[::61]) for x, y in zip(*frames)]


def start_of(path):
    return float(subprocess.run(['ffprobe', '-v', 'error', '-select_streams', 'v', '-show_entries', 'stream=start_time', '-of',
                                 'csv=p=0', str(path)], capture_output=True, text=True, check=True).stdout.split()[0])


def lines_of(path):
    return [json.loads(line) for line in open(path)]


def boxes(data, kind, *inner):
    """The contents of the boxes at a path, such as 'moov', 'trak'."""
    at = 0
    while at + 8 <= len(data):
        size, name = struct.unpack('>I4s', data[at:at + 8])
        inside = data[at + 8:at + size]
        if name.decode('latin1') == kind:
            yield from boxes(inside, *inner) if inner else [inside]
        at += max(size, 8)


def promised_times(path):
    """Nanoseconds at which the frames of an MP4 with one edit are shown, by its tables alone (ISO 14496-12): the time of
    composition minus the begin of the edit, for frames that begin inside it."""
    data = pathlib.Path(path).read_bytes()
    track, = [each for each in boxes(data, 'moov', 'trak') if b'vide' in next(boxes(each, 'mdia', 'hdlr'))]
    movie, media = (int.from_bytes(next(each)[12:16], 'big') for each in (boxes(data, 'moov', 'mvhd'), boxes(track, 'mdia', 'mdhd')))

    def runs(name):
        pairs = struct.iter_unpack('>Ii', next(boxes(track, 'mdia', 'minf', 'stbl', name))[8:])
        return [value for count, value in pairs for _ in range(count)]
    times = [time + offset for time, offset in zip(itertools.accumulate([0, *runs('stts')]), runs('ctts'))]
    (length, begin, _), = struct.iter_unpack('>IiI', next(boxes(track, 'edts', 'elst'))[8:])
    return [(time - begin) * 1e9 / media for time in sorted(times) if 0 <= time - begin < length * media / movie]


@case
def trimmed_files_give_every_frame_that_a_player_shows(folder):
    for codec, encoder, size in ('h264', H264, '320x180'), ('hevc', HEVC, '184x320'):
        drive('whole.mkv', *encoder, size=size, sound=True)
        for start, length in ('0.6', '9'), ('1.3', '0.7'), ('0.1', '1'):
            ffmpeg('-ss', start, '-i', 'whole.mkv', '-t', length, '-c', 'copy', 'trim.mp4')
            shown = shown_times('trim.mp4')
            shutil.rmtree('out', ignore_errors=True)
            ok('-q', '-o', 'out', '--set', 'overlay-alpha=0', 'trim.mp4')
            pts = [line['pts'] for line in lines_of('out/trim.jsonl')]
            equal(len(pts), len(shown), f'frames of {codec} from {start}')
            promised = promised_times('trim.mp4')
            assert all(abs(a - b) <= 1 for a, b in zip(pts, promised)), (codec, start, pts, promised)
            # ffmpeg moves all frames by as much as the first begins behind its edit, so that it is at 0.
            moved = [a - b for a, b in zip(pts, shown)]
            assert 0 <= pts[0] < 40e6 and max(abs(each - pts[0]) for each in moved) < 2e3, (codec, start, pts, shown)
            # FFmpeg 7 shows pictures whose reference was trimmed away, too: what is in them differs from run to run.
            apart = differences('trim.mp4', 'out/trim.annotated.mp4', size)
            assert max(apart[:3]) < 16 and max(apart[3:]) < 8, (codec, start, apart)


@case
def what_the_tables_of_a_file_promise_and_do_not_give_is_partial(folder):
    """No sample is missing for the demuxer, but the first group of pictures has lost its key frame."""
    drive('whole.mp4', '-c:v', 'libx264', '-bf', '0', '-g', '20', '-preset', 'ultrafast', '-x264-params', 'scenecut=0')
    data = bytearray(pathlib.Path('whole.mp4').read_bytes())
    at = data.index(b'mdat') + 4
    data[at:at + 4000] = bytes(4000)
    pathlib.Path('hole.mp4').write_bytes(data)
    ok('-q', '-o', 'out', '--outputs', 'json', 'hole.mp4', code=1)
    assert not os.path.exists('out/hole.jsonl')
    drive('short.mkv', sound=False)
    data = pathlib.Path('short.mkv').read_bytes()
    at = data.index(b'\x44\x89\x88') + 3  # the duration of the segment, a double in milliseconds
    pathlib.Path('short.mkv').write_bytes(data[:at] + struct.pack('>d', 9000) + data[at + 8:])
    contains(ok('-q', '-o', 'out', '--outputs', 'json', 'short.mkv', code=1).stderr, 'it lasts 9.0 s, and its frames end after 2.4 s')


@case
def one_of_two_video_tracks_is_taken_and_named(folder):
    drive('base.mp4')
    ffmpeg('-i', 'base.mp4', '-frames:v', '1', '-c:v', 'mjpeg', 'cover.jpg')
    ffmpeg('-i', 'base.mp4', '-i', 'base.mp4', '-map', '0', '-map', '1', '-c', 'copy', 'two.mp4')
    ffmpeg('-i', 'cover.jpg', '-i', 'base.mp4', '-map', '0:v', '-map', '1:v', '-c', 'copy', 'cover.mkv')
    for name, number in ('two.mp4', 1), ('cover.mkv', 2):
        contains(ok('-o', 'out', name).stderr, f'it has 2 video tracks; number {number} was taken')
        check_outputs(f'out/{pathlib.Path(name).stem}', 60, (320, 180))
    drive('only.avi', '-c:v', 'mjpeg', '-q:v', '3')
    equal(ok('-o', 'out', 'only.avi').stderr.count('track'), 0, 'one track of pictures is a video')


FULL = ('-c:v', 'libx264', '-crf', '10', '-pix_fmt', 'yuvj420p', '-color_range', 'pc')


def colours(space, scale):
    """Tags of ffmpeg for one colour space, behind samples that have them."""
    return ('-colorspace', space, '-color_primaries', space, '-color_trc', space, '-vf', f'{scale}:out_color_matrix={space}')


@case
def full_range_is_converted(folder):
    """Whoever tells it: the codec alone (AVI, MOV, TS, and MP4 without a colr box), or the container (MKV, MP4)."""
    drive('full.avi', '-c:v', 'mjpeg', '-q:v', '2')
    for name in 'full709.mkv', 'full709.mov', 'full709.mp4':
        drive(name, *FULL, *colours('bt709', 'scale=out_range=full'))
    drive('nocolr.mp4', *FULL, *colours('bt709', 'scale=out_range=full'), '-movflags', '-write_colr')
    drive('full601.mkv', *FULL, *colours('smpte170m', 'scale=out_range=full'))
    drive('container.mp4', '-c:v', 'mpeg4', '-q:v', '2', '-color_range', 'pc', *colours('smpte170m', 'scale=out_range=full'))
    drive('rangeonly.ts', *FULL, '-vf', 'scale=out_range=full', '-bsf:v',
          'h264_metadata=colour_primaries=2:transfer_characteristics=2:matrix_coefficients=2')
    drive('hevc.mp4', '-c:v', 'libx265', '-crf', '10', '-pix_fmt', 'yuvj420p', '-x265-params', 'log-level=error:range=full')
    drive('grey.mp4', '-c:v', 'libx264', '-crf', '10', '-color_range', 'pc', '-vf', 'scale=out_range=full,format=gray')
    os.mkdir('frames')
    drive('frames/%03d.jpg', '-q:v', '2', frames=10)
    os.mkdir('greys')
    drive('greys/%03d.png', '-vf', 'format=gray', frames=10)
    for name in ('full.avi', 'full709.mkv', 'full709.mov', 'full709.mp4', 'nocolr.mp4', 'full601.mkv', 'container.mp4',
                 'rangeonly.ts', 'hevc.mp4', 'grey.mp4', 'frames/%03d.jpg', 'greys/%03d.png'):
        stem = pathlib.Path(name).parent.name or pathlib.Path(name).stem
        shutil.rmtree('out', ignore_errors=True)
        ok('-q', '-o', 'out', '--outputs', 'annotated', '--fps', '25', '--quality', '5', '--set', 'overlay-alpha=0', name)
        made = f'out/{stem}.annotated.mp4'
        equal(probe(made).get('color_range'), 'tv', f'range of {name}')
        worst = max(differences(name, made, '320x180'))
        assert worst < 5, (name, worst)


@case
def colours_keep_their_tags(folder):
    """Also where a side is odd, and those of HDR, whose samples mean nothing without them."""
    tags = ('color_space', 'color_transfer', 'color_primaries')
    hdr = ('-c:v', 'libx265', '-pix_fmt', 'yuv420p10le', '-x265-params', 'log-level=error')
    for name, size, wanted, encoder in (
            ('bt709.mp4', '320x180', ('bt709',) * 3, ('-c:v', 'libx264')),
            ('half.mp4', '320x180', ('bt709', 'unknown', 'unknown'), ('-c:v', 'libx264')),
            ('bt601.mkv', '319x179', ('smpte170m',) * 3, ('-c:v', 'libx264', '-pix_fmt', 'yuv444p')),
            ('pq.mp4', '320x180', ('bt2020nc', 'smpte2084', 'bt2020'), hdr),
            ('hlg.mkv', '320x180', ('bt2020nc', 'arib-std-b67', 'bt2020'), hdr)):
        space, transfer, primaries = wanted
        drive(name, *encoder, '-colorspace', space, '-color_trc', transfer, '-color_primaries', primaries,
              '-vf', f'scale={size.replace("x", ":")}:out_color_matrix={space.replace("bt2020nc", "bt2020")},'
                     f'setparams=color_trc={transfer}:color_primaries={primaries}', frames=5)
        equal(tuple(probe(name).get(tag, 'unknown') for tag in tags), wanted, f'tags of {name} before')
        ok('-q', '-o', 'out', '--outputs', 'annotated', '--quality', '5', '--set', 'overlay-alpha=0', name)
        made = f'out/{pathlib.Path(name).stem}.annotated.mp4'
        equal(tuple(probe(made).get(tag, 'unknown') for tag in tags), wanted, f'tags of {name}')
        if size == '320x180':
            worst = max(differences(name, made, size))
            assert worst < 5, (name, worst)


@case
def the_outputs_of_a_run_have_one_clock(folder):
    drive('base.mp4')
    ffmpeg('-i', 'base.mp4', '-c', 'copy', 'a.ts')
    ffmpeg('-itsoffset', '2', '-i', 'base.mp4', '-f', 'lavfi', '-i', 'sine=duration=4', '-map', '0:v', '-map', '1:a', '-c:v', 'copy',
           'late.mp4')
    for name, start in ('base.mp4', 0), ('a.ts', None), ('late.mp4', 2):
        stem = pathlib.Path(name).stem
        shutil.rmtree('out', ignore_errors=True)
        ok('-q', '-o', 'out', name)
        first = lines_of(f'out/{stem}.jsonl')[0]['pts'] / 1e9
        starts = [start_of(f'out/{stem}.{kind}') for kind in ('annotated.mp4', 'masks.mkv')]
        assert all(abs(each - first) < 0.002 for each in starts), (name, first, starts)
        assert start is None or abs(first - start) < 0.002, (name, first)
        check_outputs(f'out/{stem}', 60, (320, 180))


@case
def a_name_that_no_file_can_have_fails_for_good(folder):
    long = 'n' * 246
    drive(f'{long}.mp4')
    drive('base.mp4')
    result = ok('-o', 'out', f'{long}.mp4', 'base.mp4', code=1)
    contains(result.stderr, 'names of more than 255 bytes')
    equal(left('out'), outputs_of('base'), 'the other one is whole')
    ok('-q', '-o', 'named', '--name', 'short', f'{long}.mp4')
    ok('-q', '-o', 'out', 'x' * 300 + '.mp4', code=1)


@case
def what_is_written_to_while_it_is_read_is_tried_again(folder):
    drive('other.mp4')
    for change in 'copied over', 'replaced', 'touched':
        drive('long.mp4', '-c:v', 'libx264', '-preset', 'ultrafast', size='640x360', frames=250)
        process = subprocess.Popen([PROCESS, '-q', '-o', change, '--outputs', 'json', 'long.mp4'], stderr=subprocess.PIPE, text=True)
        while not os.path.exists(f'{change}/long.jsonl.part'):
            time.sleep(0.01)
        if change == 'copied over':
            shutil.copyfile('other.mp4', 'long.mp4')
        elif change == 'replaced':
            shutil.copyfile('other.mp4', 'new.mp4')
            os.replace('new.mp4', 'long.mp4')
        else:
            os.utime('long.mp4')
        said = process.communicate()[1]
        equal(process.returncode, 75, f'{change}: {said}')
        contains(said, 'it was written to or replaced while it was read')
        assert not os.path.exists(f'{change}/long.summary.json')


@case
def lists_may_begin_with_a_byte_order_mark(folder):
    video('a.mp4', frames=3)
    video('b.mp4', frames=3)
    for number, encoding in enumerate(('utf-8-sig', 'utf-16', 'utf-8')):
        pathlib.Path('list.txt').write_bytes('a.mp4\r\nb.mp4\r\n'.encode(encoding))
        ok('-q', '-o', f'out{number}', '--outputs', 'csv', '--inputs-from', 'list.txt')
        equal(len(left(f'out{number}')), 4, encoding)


@case
def the_index_of_the_annotated_video_is_in_front(folder):
    video('clip.mp4', frames=30)
    ok('-q', '-o', 'out', 'clip.mp4')
    data = pathlib.Path('out/clip.annotated.mp4').read_bytes()
    assert data.index(b'moov') < data.index(b'mdat')
    equal(left('out'), outputs_of('clip'), 'nothing else is left')


@case
def seconds_between_two_frames_are_no_fault(folder):
    video('slow.mkv', frames=6, rate='0.15', extra=('-bf', '0'))
    equal(ok('-q', '-o', 'out', 'slow.mkv').stderr, '', 'messages')
    check_outputs('out/slow', 6, (64, 48))


@case
def two_views_in_one_picture_are_warned_of(folder):
    video('stereo.mkv', frames=3, extra=('-metadata:s:v', 'stereo_mode=left_right'))
    contains(ok('-o', 'out', 'stereo.mkv').stderr, 'stereo video (side-by-side)')


def wide_picture(path, width, height):
    def chunk(kind, data):
        return struct.pack('>I', len(data)) + kind + data + struct.pack('>I', zlib.crc32(kind + data))
    rows = (b'\0' + bytes(width)) * height
    path.write_bytes(b'\x89PNG\r\n\x1a\n' + chunk(b'IHDR', struct.pack('>IIBBBBB', width, height, 8, 0, 0, 0, 0))
                     + chunk(b'IDAT', zlib.compress(rows, 1)) + chunk(b'IEND', b''))


@case
def pictures_that_are_too_large_are_named_or_drawn_smaller(folder):
    wide_picture(folder / 'giant.png', 100000, 64)
    contains(ok('-q', '-o', 'out', 'giant.png', code=1).stderr, 'its pictures are 100000 x 64 pixels')
    for name, size in ('wide.png', (20000, 64)), ('tall.png', (64, 20000)):
        wide_picture(folder / name, *size)
        ok('-q', '-o', 'out', name)
        stem = pathlib.Path(name).stem
        masks, annotated = probe(f'out/{stem}.masks.mkv'), probe(f'out/{stem}.annotated.mp4')
        equal((masks['width'], masks['height']), size, 'masks')
        equal(max(annotated['width'], annotated['height']), 16384, 'annotated')
        equal(lines_of(f'out/{stem}.jsonl')[0]['width'], size[0], 'lines')


@case
def a_start_time_in_seconds_is_refused(folder):
    video('clip.mp4', frames=3)
    for digits in 10, 13, 16:
        contains(ok('-q', '-o', 'out', '--set', f'start-time={"1700000000000000000"[:digits]}', 'clip.mp4', code=2).stderr,
                 'a number is nanoseconds since 1970')
    ok('-q', '-o', 'out', '--set', 'start-time=1700000000000000000', 'clip.mp4')


SERVER = """
import sys, gi
gi.require_version('Gst', '1.0'); gi.require_version('GstRtspServer', '1.0')
from gi.repository import Gst, GstRtspServer, GLib
Gst.init(None)
server = GstRtspServer.RTSPServer(service=sys.argv[1])
factory = GstRtspServer.RTSPMediaFactory()
factory.set_launch('( videotestsrc is-live=true ! video/x-raw,width=64,height=48,framerate=15/1 ! x264enc tune=zerolatency '
                   'key-int-max=5 ! rtph264pay name=pay0 )')
server.get_mount_points().add_factory('/x', factory)
server.attach(None)
print('ready', flush=True)
GLib.MainLoop().run()
"""


@case
def a_server_that_dies_leaves_a_part_that_may_be_tried_again(folder):
    if subprocess.run([sys.executable, '-c', "import gi; gi.require_version('GstRtspServer', '1.0')"], stderr=subprocess.DEVNULL).returncode:
        raise Skip('no GstRtspServer for Python')
    for attempt in range(3):
        port, out = free_port(), f'out{attempt}'
        server = subprocess.Popen([sys.executable, '-c', SERVER, str(port)], stdout=subprocess.PIPE, text=True)
        equal(server.stdout.readline().strip(), 'ready')
        process = subprocess.Popen([PROCESS, '-q', '-o', out, '--outputs', 'csv', f'rtsp://127.0.0.1:{port}/x'], stderr=subprocess.PIPE,
                                   text=True)
        until = time.time() + 20
        while time.time() < until and not (os.path.exists(f'{out}/x.csv.part') and os.stat(f'{out}/x.summary.json.part')):
            time.sleep(0.05)
        time.sleep(3)
        server.kill()
        server.wait()
        said = process.communicate(timeout=60)[1]
        equal((process.returncode, left(out)), (75, ['x.partial.csv', 'x.partial.summary.json']), said)


if __name__ == '__main__':
    for tool in 'ffmpeg', 'ffprobe':
        if not shutil.which(tool):
            sys.exit(f'{tool} is missing: apt-get install ffmpeg')
    main(CASES, at_once=2)
