#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""terrainseg-process as scripts use it: outputs, damage, interruption, resuming. TERRAINSEG_PROCESS is the program."""
import csv
import json
import os
import pathlib
import pty
import resource
import select
import shutil
import signal
import subprocess
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))
from tap import contains, equal, main  # noqa: E402

PROCESS = os.environ['TERRAINSEG_PROCESS']
KINDS = ('annotated.mp4', 'masks.mkv', 'jsonl', 'csv')
CASES = []


def case(function):
    CASES.append(function)
    return function


def run(*arguments, **options):
    return subprocess.run([PROCESS, *map(str, arguments)], capture_output=True, text=True, timeout=120,
                          stdin=subprocess.DEVNULL, **options)


def ok(*arguments, code=0, **options):
    result = run(*arguments, **options)
    assert result.returncode == code, f'exit {result.returncode} instead of {code}: {result.stderr}{result.stdout}'
    return result


def ffmpeg(*arguments):
    subprocess.run(['ffmpeg', '-nostdin', '-v', 'error', '-y', *map(str, arguments)], check=True)


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
    equal((annotated['width'], annotated['height']), (width + width % 2, height + height % 2), 'annotated size')
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
    equal(result.stderr, '')


@case
def same_names_in_different_places_do_not_overwrite(folder):
    for place in 'a', 'b':
        os.mkdir(place)
        video(f'{place}/clip.mp4', frames=3)
    video('a/clip.mkv', frames=4)
    ok('-q', '-o', 'out', 'a/clip.mp4', 'b/clip.mp4', 'a/clip.mkv', './a/../a/clip.mkv')
    equal(left('out'), outputs_of('a_clip.mp4', 'b_clip.mp4', 'clip.mkv'), 'outputs')


@case
def an_input_is_never_overwritten(folder):
    video('clip.mp4')
    os.rename('clip.mp4', 'annotated.mp4')
    before = pathlib.Path('annotated.mp4').read_bytes()
    result = ok('--name', '', 'annotated.mp4', code=1)
    contains(result.stderr, 'would replace the input')
    equal(pathlib.Path('annotated.mp4').read_bytes(), before, 'the input')
    equal(left('.'), ['annotated.mp4'], 'files')


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
    equal(set(raw('out/clip.masks.mkv', 'gray')[y * 160 + x] for y in range(16) for x in range(16)), {128},
          'the ignored corner')


@case
def wrong_usage_is_refused_before_anything_is_written(folder):
    video('clip.mp4', frames=3)
    video('other.mp4', frames=3)
    for arguments, text in (
            (['--set', 'no-such=1'], "no property 'no-such'"),
            (['--set', 'caution=33'], '-32..32'),
            (['--set', 'caution=many'], 'caution'),
            (['--set', 'horizon=sideways'], 'one of off, paper, auto'),
            (['--set', 'caution'], 'PROPERTY=VALUE'),
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
            (['--name', 'a/b'], "'/'"),
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
def one_image_is_a_short_sequence(folder):
    images(folder / 'x', 1)
    ok('-q', '-o', 'out', 'x/0000.png')
    check_outputs('out/0000', 1, (64, 48))


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
    equal(result.stdout.count('skipped'), 3, 'skipped')
    equal(len(result.stdout.splitlines()), 3, 'lines')


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
    for size in ((65, 49), (64, 49), (33, 48), (17, 17)):
        name = f'odd{size[0]}x{size[1]}'
        ffmpeg('-f', 'lavfi', '-i', f'testsrc=size={size[0]}x{size[1]}:rate=24', '-frames:v', 4, '-pix_fmt', 'yuv420p',
               '-c:v', 'ffv1', f'{name}.mkv')
        equal((probe(f'{name}.mkv')['width'], probe(f'{name}.mkv')['height']), size, 'the input')
        ok('-q', '-o', 'out', f'{name}.mkv')
        check_outputs(f'out/{name}', 4, size)


@case
def rotated_video_is_turned_upright(folder):
    video('flat.mp4', frames=6, size='96x64')
    ffmpeg('-display_rotation', '90', '-i', 'flat.mp4', '-c', 'copy', 'turned.mp4') if supports_display_rotation() \
        else ffmpeg('-i', 'flat.mp4', '-c', 'copy', '-metadata:s:v', 'rotate=90', 'turned.mp4')
    ok('-q', '-o', 'out', 'flat.mp4', 'turned.mp4')
    check_outputs('out/flat', 6, (96, 64))
    check_outputs('out/turned', 6, (64, 96))


def supports_display_rotation():
    text = subprocess.run(['ffmpeg', '-h', 'full'], capture_output=True, text=True).stdout
    return '-display_rotation' in text


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
    contains(result.stdout, 'PARTIAL')
    equal([name for name in left('out') if name.startswith('cut') and 'partial' not in name], [], 'looks whole')
    # Repaired, it is done again and the partial files go.
    pathlib.Path('cut.mp4').write_bytes(whole)
    result = ok('-o', 'out', '--resume', 'cut.mp4', 'good.mp4')
    contains(result.stdout, 'good.mp4: complete already')
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
def an_image_of_another_type_is_named(folder):
    images(folder / 'frames', 6)
    pathlib.Path('frames/0004.png').write_text('not an image at all')
    result = ok('-o', 'out', 'frames', code=1)
    contains(result.stderr, '0004.png: this is no image')
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
    result = ok('-o', 'out', *names, 'good.mp4', code=1)
    lines = result.stderr.splitlines()
    for name in names:
        assert sum(f': {name}: ' in line for line in lines) == 1, (name, result.stderr)
    contains(result.stderr, 'sound.m4a: there is no video in it, only audio/')
    contains(result.stderr, 'absent.mp4: there is no such file')
    contains(result.stderr, 'hollow: there is no video and no image')
    equal(left('out'), outputs_of('good'), 'outputs')


def start_long_run(out):
    video('long.mp4', frames=2000, size='320x240')
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
    equal(left('out'), sorted(f'long.{kind}.part' for kind in KINDS), 'after kill -9')
    ok('-q', '-o', 'out', '--resume', 'long.mp4')
    equal(left('out'), outputs_of('long'), 'after the second run')
    equal(json.load(open('out/long.summary.json'))['frames'], 2000, 'frames')


@case
def interrupted_leaves_nothing_unfinished(folder):
    for number in signal.SIGINT, signal.SIGTERM:
        process = start_long_run('out')
        process.send_signal(number)
        _, text = process.communicate(timeout=30)
        equal(process.returncode, 128 + number, 'exit code')
        contains(text.decode(), 'interrupted')
        equal(left('out'), [], 'after the signal')


@case
def two_runs_never_write_the_same_file(folder):
    first = start_long_run('out')
    try:
        result = ok('-o', 'out', 'long.mp4', code=1)
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
        return ok('-o', 'out', '--resume', *arguments, 'a.mp4', 'b.mp4').stdout.count('skipped')

    equal(skipped(), 2, 'unchanged')
    equal(skipped('--set', 'caution=4'), 0, 'other settings')
    equal(skipped('--set', 'caution=4'), 2, 'the same settings again')
    os.truncate('out/a.masks.mkv', 100)
    equal(skipped('--set', 'caution=4'), 1, 'an output was cut')
    os.remove('out/b.csv')
    equal(skipped('--set', 'caution=4'), 1, 'an output is gone')
    video('a.mp4', frames=5)
    equal(skipped('--set', 'caution=4'), 1, 'the input changed')
    pathlib.Path('out/a.summary.json').write_text('{"complete": true')
    equal(skipped('--set', 'caution=4'), 1, 'the record is damaged')
    pathlib.Path('out/a.summary.json').write_text('[1, 2]')
    equal(skipped('--set', 'caution=4'), 1, 'the record is something else')
    equal(skipped('--set', 'caution=4', '--outputs', 'csv'), 0, 'fewer outputs have other settings')


@case
def an_output_folder_that_cannot_be_written(folder):
    video('clip.mp4', frames=3)
    pathlib.Path('file').write_text('')
    for place in ('file/sub', '/proc/terrainseg', 'file'):
        result = ok('-o', place, 'clip.mp4', code=4)
        contains(result.stderr, place)
    os.makedirs('out/clip.masks.mkv')
    contains(ok('-o', 'out', 'clip.mp4', code=1).stderr, 'clip.masks.mkv: Is a directory')
    equal(left('out'), ['clip.masks.mkv'], 'nothing else')


@case
def a_full_disk_is_reported_and_leaves_nothing(folder):
    video('clip.mp4', frames=200, size='320x240')

    def small_files():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))

    result = run('-o', 'out', 'clip.mp4', preexec_fn=small_files)
    equal(result.returncode, 1, result.stderr)
    contains(result.stderr, 'clip.mp4: cannot write out/clip.')
    equal(left('out'), [], 'nothing is kept')


@case
def a_missing_plugin_is_named_with_its_package(folder):
    video('clip.mp4', frames=3)
    system = pathlib.Path(subprocess.run(['pkg-config', '--variable=pluginsdir', 'gstreamer-1.0'], capture_output=True,
                                         text=True, check=True).stdout.strip())
    os.mkdir('plugins')
    for plugin in system.glob('*.so'):
        if plugin.name not in ('libgstlibav.so', 'libgstisomp4.so'):
            os.symlink(plugin, f'plugins/{plugin.name}')
    environment = dict(os.environ, GST_PLUGIN_SYSTEM_PATH=str(folder / 'plugins'), GST_REGISTRY=str(folder / 'registry'))
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
    subprocess.run(['meson', 'install', '-C', os.environ['TERRAINSEG_BUILD'], '--no-rebuild', '--destdir',
                    folder / 'moved'], check=True, capture_output=True)
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
    contains(ok('-q', '-o', 'out', 'clip.mp4', 'absent.mp4', code=1).stderr, 'absent.mp4')


@case
def a_uri_is_an_input_too(folder):
    video('clip.mp4', frames=3)
    ok('-q', '-o', 'out', (folder / 'clip.mp4').as_uri())
    check_outputs('out/clip', 3, (64, 48))


if __name__ == '__main__':
    for tool in 'ffmpeg', 'ffprobe':
        if not shutil.which(tool):
            sys.exit(f'{tool} is missing: apt-get install ffmpeg')
    main(CASES)
