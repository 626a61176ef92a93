#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""`terrainseg-process --outputs mcap` as scripts use it, read by a small reader of MCAP's summary that stands here."""
import ctypes
import errno
import json
import os
import pathlib
import signal
import struct
import subprocess
import sys
import time
import zlib

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))
from process_test import FULL, PROCESS, colours, differences, drive, left, ok, probe, run, video  # noqa: E402
from tap import Skip, contains, equal, main  # noqa: E402

MAGIC = b'\x89MCAP0\r\n'
CASES = []
TOPICS = {'/terrain/scan', '/terrain/points', '/terrain/grid', '/terrain/mask', '/camera/camera_info', '/camera/video', '/tf'}
BAG = ['metadata.yaml', 'terrain.mcap']
CALIBRATION = 'image_width: 160\nimage_height: 120\ncamera_matrix: {rows: 3, cols: 3, data: [130, 0, 80, 0, 130, 60, 0, 0, 1]}\n'
METRES = ('--camera-info', 'camera.yaml', '--mount', 'height=0.5,pitch=10deg')


def case(function):
    CASES.append(function)
    return function


def records(data, at):
    while at < len(data) - len(MAGIC):
        opcode, length = struct.unpack_from('<BQ', data, at)
        yield opcode, data[at + 9:at + 9 + length]
        at += 9 + length


def summary_of(path):
    """Messages by topic; checksums and places are checked on the way."""
    data = pathlib.Path(path).read_bytes()
    assert data.startswith(MAGIC) and data.endswith(MAGIC), 'the magic'
    footer = len(data) - len(MAGIC) - 29
    opcode, length, summary, offsets, crc = struct.unpack_from('<BQQQI', data, footer)
    equal((opcode, length), (2, 20), 'footer')
    equal(zlib.crc32(data[summary:footer + 25]), crc, 'checksum of the summary')
    assert 0 < summary < offsets < footer
    opcode, length, crc = struct.unpack_from('<BQI', data, summary - 13)
    equal((opcode, length, zlib.crc32(data[:summary - 13])), (15, 4, crc), 'end of the data')
    topics, counts, total = {}, {}, None
    for opcode, content in records(data, summary):
        if opcode == 4:
            number, _, size = struct.unpack_from('<HHI', content)
            topics[number] = content[8:8 + size].decode()
        elif opcode == 8:
            start, length = struct.unpack_from('<QQ', content, 16)
            equal(data[start], 6, 'a chunk stands where the index says')
            equal(struct.unpack_from('<Q', data, start + 1)[0] + 9, length, 'its length')
        elif opcode == 11:
            total, = struct.unpack_from('<Q', content)
            size, = struct.unpack_from('<I', content, 42)
            counts = dict(struct.unpack_from('<HQ', content, 46 + i) for i in range(0, size, 10))
    found = {topics[number]: count for number, count in counts.items()}
    equal(sum(found.values()), total, 'messages')
    return found


def check_bag(folder, frames, topics=TOPICS):
    found = summary_of(f'{folder}/terrain.mcap')
    diagnostics = found.pop('/diagnostics')  # with each change of what is learned, and once a second
    assert 1 <= diagnostics <= frames, diagnostics
    equal(found, dict.fromkeys(topics, frames), 'messages')
    text = pathlib.Path(folder, 'metadata.yaml').read_text()
    contains(text, f'message_count: {frames * len(topics) + diagnostics}\n')
    contains(text, '- "terrain.mcap"\n')
    for topic in topics:
        contains(text, f'name: {topic}\n')


@case
def a_bag_holds_every_frame(folder):
    pathlib.Path('camera.yaml').write_text(CALIBRATION)
    video('drive.mp4', frames=40, size='160x120')
    ok('-q', '-o', 'out', '--outputs', 'mcap,json,csv', *METRES, '--manifest', 'm', 'drive.mp4')
    equal(left('out'), ['drive.bag', 'drive.csv', 'drive.jsonl', 'drive.summary.json'], 'outputs')
    equal(left('out/drive.bag'), BAG, 'the bag')
    check_bag('out/drive.bag', 40)
    lines = [json.loads(line) for line in open('out/drive.jsonl')]
    assert all(line['metric']['height'] == 0.5 for line in lines), 'the calibration reaches the lines'
    record = json.load(open('out/drive.summary.json'))
    equal(record['outputs']['mcap'], {'file': 'drive.bag/terrain.mcap', 'bytes': os.path.getsize('out/drive.bag/terrain.mcap')}, 'record')
    ok('-q', '--check', 'm')
    with open('out/drive.bag/terrain.mcap', 'ab') as file:
        file.write(b'x')
    contains(ok('-q', '--check', 'm', code=75).stderr, 'drive.bag/terrain.mcap has')


@case
def without_a_calibration_it_has_mask_and_video(folder):
    video('odd.mkv', frames=5, size='65x49', extra=('-c:v', 'ffv1'))
    ok('-q', '-o', 'out', '--outputs', 'mcap', '--name', '', 'odd.mkv')
    equal(left('out'), ['summary.json', 'terrain.bag'], 'outputs')
    check_bag('out/terrain.bag', 5, {'/terrain/mask', '/camera/video'})
    # Not among the outputs that come without being asked for.
    ok('-q', '-o', 'all', 'odd.mkv')
    assert not os.path.exists('all/odd.bag')


def recorded_video(path):
    """The H.264 of a recording; its chunks are unpacked by the library that packed them."""
    zstd, data, video = ctypes.CDLL('libzstd.so.1'), pathlib.Path(path).read_bytes(), b''
    topics = {}
    for opcode, content in records(data, len(MAGIC)):
        if opcode != 6:
            continue
        size, = struct.unpack_from('<Q', content, 16)
        name, = struct.unpack_from('<I', content, 28)
        packed, chunk = content[40 + name:], ctypes.create_string_buffer(size)
        if name:
            zstd.ZSTD_decompress(chunk, ctypes.c_size_t(size), packed, ctypes.c_size_t(len(packed)))
        for inner, message in records((chunk.raw if name else packed) + MAGIC, 0):
            if inner == 4:
                topics[struct.unpack_from('<H', message)[0]] = message[8:8 + struct.unpack_from('<I', message, 4)[0]]
            elif inner == 5 and topics[struct.unpack_from('<H', message)[0]] == b'/camera/video':
                video += message[message.index(b'\0\0\0\1', 22):]
    return video


@case
def the_video_of_a_bag_has_the_colours_of_its_input(folder):
    os.mkdir('greys')
    drive('greys/%03d.png', '-vf', 'format=gray', frames=5)
    drive('full.mp4', *FULL, *colours('bt709', 'scale=out_range=full'), frames=5)
    drive('rgb.mkv', '-c:v', 'ffv1', '-pix_fmt', 'bgr0', frames=5)
    for name, space in ('greys', 'pc'), ('full.mp4', 'pc'), ('rgb.mkv', 'tv'):
        ok('-q', '-o', 'out', '--outputs', 'mcap', '--quality', '5', name)
        stem = pathlib.Path(name).stem
        pathlib.Path(f'{stem}.h264').write_bytes(recorded_video(f'out/{stem}.bag/terrain.mcap'))
        equal(probe(f'{stem}.h264')['color_range'], space, f'range of {name}')
        worst = max(differences('greys/%03d.png' if name == 'greys' else name, f'{stem}.h264', '320x180'))
        assert worst < 5, (name, worst)


@case
def another_calibration_is_another_setting(folder):
    pathlib.Path('camera.yaml').write_text(CALIBRATION)
    video('clip.mp4', frames=3, size='160x120')

    def skipped():
        return 'skipped' in ok('-o', 'out', '--outputs', 'mcap', '--resume', *METRES, 'clip.mp4').stdout

    equal([skipped(), skipped()], [False, True], 'the same')
    pathlib.Path('camera.yaml').write_text(CALIBRATION.replace('130', '131'))
    equal([skipped(), skipped()], [False, True], 'the file changed')
    os.remove('out/clip.bag/metadata.yaml')
    equal([skipped(), skipped()], [False, True], 'a part of the bag is gone')


@case
def wrong_calibrations_touch_nothing(folder):
    pathlib.Path('camera.yaml').write_text(CALIBRATION)
    pathlib.Path('other.yaml').write_text('a: 1\n')
    video('clip.mp4', frames=3)
    for arguments, said in (
            (METRES[:2], '--camera-info and --mount'), (METRES[2:], '--camera-info and --mount'),
            (('--camera-info', 'absent.yaml', *METRES[2:]), '"absent.yaml" of property camera-info'),
            (('--camera-info', 'other.yaml', *METRES[2:]), '"other.yaml" of property camera-info'),
            ((*METRES[:2], '--mount', 'height=0'), '"height=0" of property mount'),
            (('--outputs', 'mcap-metadata'), "'mcap-metadata' is not one of annotated, masks, json, csv, mcap")):
        contains(ok('-q', '-o', 'out', *arguments, 'clip.mp4', code=2).stderr, said)
    assert not os.path.exists('out')


@case
def a_damaged_input_gives_a_partial_bag(folder):
    video('cut.mkv', frames=200, size='160x120')
    os.truncate('cut.mkv', os.path.getsize('cut.mkv') // 2)
    ok('-q', '-o', 'out', '--outputs', 'mcap', 'cut.mkv', code=1)
    equal(left('out'), ['cut.partial.bag', 'cut.partial.summary.json'], 'outputs')
    frames = json.load(open('out/cut.partial.summary.json'))['frames']
    assert 0 < frames < 200, frames
    check_bag('out/cut.partial.bag', frames, {'/terrain/mask', '/camera/video'})
    video('cut.mkv', frames=20, size='160x120')
    os.remove('out/cut.partial.summary.json')
    contains(ok('-q', '-o', 'out', '--outputs', 'mcap', 'cut.mkv', code=2).stderr, 'cut.partial.bag/terrain.mcap already exists')


@case
def a_killed_run_leaves_a_readable_part(folder):
    video('long.mp4', frames=3000, size='160x120')
    process = subprocess.Popen([PROCESS, '-q', '-o', 'out', '--outputs', 'mcap', 'long.mp4'], stderr=subprocess.PIPE)
    part = pathlib.Path('out/long.bag/terrain.mcap.part')
    deadline = time.monotonic() + 60
    while not (part.exists() and part.stat().st_size > 20000):
        assert process.poll() is None and time.monotonic() < deadline, 'it never began'
        time.sleep(0.01)
    process.kill()
    process.communicate()
    equal(left('out/long.bag'), ['metadata.yaml.part', 'terrain.mcap.part'], 'after kill -9')
    data = part.read_bytes()
    assert data.startswith(MAGIC)
    whole = [opcode for opcode, content in records(data + MAGIC, 8)]
    assert whole.count(6) >= 1 and set(whole) <= {1, 6, 7}, whole[:9]
    ok('-q', '-o', 'out', '--outputs', 'mcap', '--frames', '30', 'long.mp4')
    equal(left('out/long.bag'), BAG, 'after the second run')
    check_bag('out/long.bag', 30, {'/terrain/mask', '/camera/video'})


def with_fault(fault, out):
    environment = dict(os.environ, LD_PRELOAD=os.environ['TERRAINSEG_FAULTS'], FAULT=fault)
    return run('-q', '-o', out, '--outputs', 'mcap', 'clip.mp4', env=environment)


@case
def a_failing_disk_at_any_moment_is_told(folder):
    if 'TERRAINSEG_FAULTS' not in os.environ:
        raise Skip('a sanitizer and a preloaded library do not go together')
    video('clip.mp4', frames=6, size='160x120')
    equal(with_fault(f'count:{folder}/count', 'whole').returncode, 0, 'without a fault')
    count = int(pathlib.Path('count').read_text())
    assert count >= 12, count  # four writes of the recording, two files and two records written, synced, renamed
    for number in range(1, count + 1):
        out = f'error{number}'
        error = errno.ENOSPC if number % 2 else errno.EIO
        result = with_fault(f'{int(error)}:{number}', out)
        equal(result.returncode, 75, f'{out}: {result.stderr}')
        contains(result.stderr, os.strerror(error))
        contains(result.stderr, f'{out}/clip.')
        for path in pathlib.Path(out).rglob('*'):
            assert path.is_dir() or path.suffix in ('.json', '.mcap', '.yaml'), path
        if os.path.exists(f'{out}/clip.bag'):
            assert left(f'{out}/clip.bag'), f'{out}: an empty bag stays'
        ok('-q', '-o', out, '--outputs', 'mcap', '--resume', 'clip.mp4')
        check_bag(f'{out}/clip.bag', 6, {'/terrain/mask', '/camera/video'})


@case
def an_interrupted_run_leaves_nothing(folder):
    video('long.mp4', frames=3000, size='160x120')
    process = subprocess.Popen([PROCESS, '-q', '-o', 'out', '--outputs', 'mcap', 'long.mp4'], stderr=subprocess.PIPE)
    deadline = time.monotonic() + 60
    while not os.path.exists('out/long.bag/terrain.mcap.part'):
        assert process.poll() is None and time.monotonic() < deadline, 'it never began'
        time.sleep(0.01)
    time.sleep(0.3)
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=30)
    equal((process.returncode, left('out')), (130, []), 'after the signal')


if __name__ == '__main__':
    main(CASES)
