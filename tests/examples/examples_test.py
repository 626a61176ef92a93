#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""The examples as users run them. TERRAINSEG_EXAMPLES is their folder, READ_MASK, CORE_ONLY and RTSP_SERVER are the built
programs."""
import importlib.util
import json
import os
import pathlib
import re
import shutil
import socket
import subprocess
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))
from ports import free_port  # noqa: E402
from tap import Skip, contains, equal, main  # noqa: E402

EXAMPLES = pathlib.Path(os.environ['TERRAINSEG_EXAMPLES'])
PYTHON = '/usr/bin/python3'
CASES = []


def case(function):
    CASES.append(function)
    return function


def run(*arguments, code=0, **options):
    result = subprocess.run([str(each) for each in arguments], capture_output=True, timeout=100,
                            text=options.pop('text', True), **{'stdin': subprocess.DEVNULL, **options})
    assert result.returncode == code, f'{arguments}: exit {result.returncode}: {result.stderr}{result.stdout}'
    return result


def launch(text):
    run('gst-launch-1.0', '-q', '-e', *text.split())


def scene(name, frames=20, size=(96, 64)):
    launch(f'terrainscenesrc num-buffers={frames} ! video/x-raw,format=I420,width={size[0]},height={size[1]} ! '
           f'x264enc ! mp4mux ! filesink location={name}')
    return name


def reference_lines(source, settings=''):
    launch(f'{source} ! terrainseg {settings} ! terrainextract ! application/x-ndjson ! filesink location=reference.jsonl')
    return [json.loads(line) for line in open('reference.jsonl')]


def module(name):
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / 'python' / f'{name}.py')
    loaded = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(loaded)
    return loaded


@case
def mask_to_numpy_gives_the_mask(folder):
    module_ = module('mask_to_numpy')
    source = 'terrainscenesrc num-buffers=12 ! video/x-raw,format=I420,width=97,height=65'
    launch(f'{source} ! terrainseg ! terrainextract ! video/x-raw,format=GRAY8 ! multifilesink location=%02d.gray')
    lines = reference_lines(source)
    frames = list(module_.frames(source, picture=True))
    equal(len(frames), 12, 'frames')
    for index, (frame, line) in enumerate(zip(frames, lines)):
        equal(frame['mask'].shape, (65, 97), 'shape')
        rows = pathlib.Path(f'{index:02d}.gray').read_bytes()
        stride = len(rows) // 65
        expected = b''.join(rows[y * stride:y * stride + 97] for y in range(65))
        assert frame['mask'].tobytes() == expected, f'mask {index} differs'
        equal(frame['horizon'], line['horizon']['row'], 'horizon')
        equal(frame['frame'], index, 'frame')
        equal(len(frame['boundary']), 97, 'boundary')
        equal(frame['picture'].shape, (65, 97, 3), 'picture')
        assert abs(frame['traversable'] - line['traversable']) < 0.0011


@case
def mask_to_numpy_is_a_program_too(folder):
    os.rename(scene('drive.mp4'), 'dri ve.mp4')
    lines = run(PYTHON, EXAMPLES / 'python/mask_to_numpy.py', 'dri ve.mp4').stdout.splitlines()
    equal(len(lines), 20, 'lines')
    contains(lines[-1], 'frame 19: 96x64 mask')
    run(PYTHON, EXAMPLES / 'python/mask_to_numpy.py', 'absent.mp4', code=1)


@case
def steering_follows_the_widest_space(folder):
    steer = module('steer').steer
    height, none = 100, 100
    equal(steer([none] * 20, height, 0.25), None, 'nothing is free')
    equal(steer([80] * 20, height, 0.25), None, 'free, but not deep enough')
    angle, speed = steer([40] * 20, height, 0.25)
    equal(angle, 0.0, 'all free: straight on')
    assert speed == 1.0, speed
    angle, _ = steer([40] * 6 + [none] * 14, height, 0.25)
    assert abs(angle + 0.7) < 1e-9, angle
    angle, _ = steer([40] * 4 + [none] * 6 + [40] * 10, height, 0.25)
    assert abs(angle - 0.5) < 1e-9, 'the wider of two'
    angle, _ = steer([40] * 4 + [none] * 4 + [40] * 4 + [none] * 4 + [40] * 4, height, 0.25)
    assert abs(angle) < 1e-9, 'the middle one of equals'
    slow, fast = (steer([row] * 4 + [none] * 16, height, 0.1)[1] for row in (85, 40))
    assert slow < fast, 'a short way is driven slowly'


@case
def steering_stops_when_nothing_is_known(folder):
    program = EXAMPLES / 'python/steer.py'
    # On a busy machine a picture may take its time.
    lines = [line for line in run(PYTHON, program).stdout.splitlines() if line != 'stop: no picture']
    equal(len(lines), 90, 'commands')
    assert all(re.fullmatch(r'frame \d+ (steer [+-]\d\.\d{3} speed \d\.\d\d|stop: .*)', line) for line in lines), lines
    assert sum('steer' in line for line in lines) > 45, 'on an open road it drives'
    lines = [line for line in run(PYTHON, program, '--settings', 'learning=false').stdout.splitlines()
             if line.startswith('frame')]
    equal({line.split(' ', 2)[2] for line in lines}, {'stop: blocked'}, 'without knowledge')


@case
def steering_stops_when_no_picture_comes(folder):
    lines = run(PYTHON, EXAMPLES / 'python/steer.py', '--settings', '! identity sleep-time=800000',
                scene('drive.mp4', frames=4)).stdout.splitlines()
    equal(sum(line.startswith('frame') for line in lines), 4, 'commands')
    assert lines.count('stop: no picture') >= 3, lines


@case
def c_reads_what_the_lines_say(folder):
    source = 'terrainscenesrc num-buffers=60 ! video/x-raw,width=320,height=180'
    expected = reference_lines(source)
    lines = run(os.environ['READ_MASK']).stdout.splitlines()
    equal(len(lines), 60, 'lines')
    for line, want in zip(lines, expected):
        frame, horizon, share, counted, ahead = map(int, re.match(
            r'frame (\d+) horizon (-?\d+) traversable (\d+) counted (\d+) ahead (\d+)', line).groups())
        row = want['horizon']['row']
        equal((frame, horizon), (want['frame'], -1 if row is None else row), 'frame and horizon')
        assert abs(share - 1000 * want['traversable']) <= 1.01 and abs(share - counted) <= 1, line
        assert abs(180 - ahead - 180 * want['boundary'][160]) < 1, (line, want['boundary'][160])
    run(os.environ['READ_MASK'], 'absent.mp4', code=1)


@case
def c_is_compiled_as_its_comment_says(folder):
    """With pkg-config alone, against an installation."""
    build = os.environ['TERRAINSEG_BUILD']
    run('meson', 'install', '-C', build, '--no-rebuild', '--destdir', folder / 'root')
    os.mkdir('pc')
    for description in (folder / 'root').rglob('*.pc'):
        text = description.read_text()
        prefix = re.search('^prefix=(.*)$', text, re.M).group(1)
        pathlib.Path('pc', description.name).write_text(text.replace(prefix, f'{folder}/root{prefix}', 1))
    library = next((folder / 'root').rglob('libterrainseg.so')).parent
    environment = dict(os.environ, PKG_CONFIG_PATH=str(folder / 'pc'))
    for source, compiler, modules in (
            (EXAMPLES / 'c/read_mask.c', ['cc'],
             ['gstreamer-terrainseg-1.0', 'gstreamer-app-1.0']),
            (EXAMPLES / 'cpp/core_only.cpp', ['c++', '-std=c++20'], ['terrainseg'])):
        assert f"$(pkg-config --cflags --libs {' '.join(modules)})" in source.read_text(), source
        flags = run('pkg-config', '--cflags', '--libs', *modules, env=environment).stdout.split()
        run(*compiler, source, '-o', 'program', *flags, f'-Wl,-rpath,{library}')
        equal(run('./program', 'absent', 'x', code=1 if 'c/' in str(source) else 2).stdout, '', 'it starts')


@case
def core_alone_gives_the_same_masks_as_the_element(folder):
    size = (96, 66)
    source = f'terrainscenesrc num-buffers=10 ! video/x-raw,format=I420,width={size[0]},height={size[1]},framerate=30/1'
    launch(f'{source} ! filesink location=frames.i420')
    launch(f'{source} ! terrainseg caution=2 ! terrainextract ! video/x-raw,format=GRAY8 ! filesink location=masks')
    frames, masks = pathlib.Path('frames.i420').read_bytes(), pathlib.Path('masks').read_bytes()
    equal(len(frames), 10 * size[0] * size[1] * 3 // 2, 'bytes without padding')
    result = run(os.environ['CORE_ONLY'], f'{size[0]}x{size[1]}', input=frames, stdin=None, text=False)
    header = b'P5\n%d %d\n255\n' % size
    pictures = result.stdout.split(header)
    equal((pictures[0], len(pictures)), (b'', 11), 'masks')
    assert b''.join(pictures[1:]) == masks, 'masks of core and element differ'
    equal(len(result.stderr.splitlines()), 10, 'lines')


@case
def core_alone_reads_ppm_and_refuses_half_pictures(folder):
    launch('terrainscenesrc num-buffers=3 ! video/x-raw,width=64,height=48 ! videoconvert ! pnmenc ! '
           'filesink location=pictures.ppm')
    pictures = pathlib.Path('pictures.ppm').read_bytes()
    result = run(os.environ['CORE_ONLY'], input=pictures, stdin=None, text=False)
    equal(len(result.stdout), 3 * (len(b'P5\n64 48\n255\n') + 64 * 48), 'bytes')
    for broken in pictures[:-1], b'P6\n64 x', b'P5\n4 4\n255\n' + bytes(16), b'P6 99999999999 1 255\n':
        result = run(os.environ['CORE_ONLY'], input=broken, stdin=None, text=False, code=1)
        contains(result.stderr, b'breaks off')
    for arguments in ['0x4'], ['64'], ['64x48x2'], ['64x48', '0'], ['64x48', '30', 'x']:
        contains(run(os.environ['CORE_ONLY'], *arguments, code=2).stderr, 'usage')


def write_png(path, rows, depth):
    """Rows of bytes as they lie in a PNG: 8-bit RGB, or 16-bit grey for depth."""
    import struct
    import zlib

    def chunk(kind, data):
        return struct.pack('>I', len(data)) + kind + data + struct.pack('>I', zlib.crc32(kind + data))

    width = len(rows[0]) // (2 if depth else 3)
    header = struct.pack('>IIBBBBB', width, len(rows), 16 if depth else 8, 0 if depth else 2, 0, 0, 0)
    path.write_bytes(b'\x89PNG\r\n\x1a\n' + chunk(b'IHDR', header) +
                     chunk(b'IDAT', zlib.compress(b''.join(b'\0' + row for row in rows))) + chunk(b'IEND', b''))


@case
def depth_says_what_the_ground_is(folder):
    """A red mat hides the ground in the window on the right; the range sensor sees floor on the left, where it is grey."""
    import math
    width, height, frames = 160, 120, 4
    for n in range(frames):
        rows, depths = [], []
        for y in range(height):
            floor = 1000 * math.exp(0.9 * (height - 0.5 - y) / height)
            row, millimetres = b'', b''
            for x in range(width):
                # Above row 40 a blue wall; on the right a red box that stands on the floor, nearer than it.
                box = x >= 104 and y >= 48
                noise = (x * 7 + y * 13 + n) % 9
                colour = (20, 30, 200) if y < 40 else (200, 30, 20) if box else (100, 100, 100)
                row += bytes(min(255, c + noise) for c in colour)
                millimetres += int(floor * (0.5 if box else 1) if y >= 40 else 9000).to_bytes(2, 'big')
            rows.append(row)
            depths.append(millimetres)
        write_png(folder / f'picture{n:04d}.png', rows, False)
        write_png(folder / f'depth{n:04d}.png', depths, True)
    # The window is put where the box stands: alone, the filter would learn the box.
    window = ['window-x=112', 'window-width=40', 'window-height=24', 'preset=paper', 'pyramid-levels=1']
    told = run(os.environ['SUPERVISE'], 'picture%04d.png', 'depth%04d.png', 'lines.jsonl', *window, cwd=folder)
    contains(told.stdout, f'{frames} frames, {frames} of them supervised')
    with_depth = [json.loads(line) for line in open(folder / 'lines.jsonl')]
    launch(f'multifilesrc location={folder}/picture%04d.png caps=image/png,framerate=5/1 ! pngdec ! videoconvert ! '
           f'video/x-raw,format=I420 ! terrainseg {" ".join(window)} ! terrainextract json-mask=true ! '
           f'application/x-ndjson ! filesink location={folder}/alone.jsonl')
    alone = [json.loads(line) for line in open(folder / 'alone.jsonl')]
    equal(len(with_depth), frames)
    grey, red = (60, 100), (130, 80)
    equal([pixel(line, *grey) for line in with_depth], [255] * frames)
    equal([pixel(line, *red) for line in with_depth], [0] * frames)
    equal(pixel(alone[-1], *red), 255)
    equal(pixel(alone[-1], *grey), 0)


def pixel(line, x, y):
    """The mask of a JSON line at a pixel: runs of [value, length], row by row."""
    mask, at = line['mask'], 0
    place = y * mask['height'] // line['height'] * mask['width'] + x * mask['width'] // line['width']
    for value, length in zip(mask['runs'][::2], mask['runs'][1::2]):
        at += length
        if place < at:
            return value


@case
def supervising_wants_its_arguments(folder):
    contains(run(os.environ['SUPERVISE'], code=2).stderr, 'usage: supervise')
    contains(run(os.environ['SUPERVISE'], 'none%d.png', 'none%d.png', 'x.jsonl', cwd=folder, code=1).stderr, 'none')


def start_broker(port):
    program = shutil.which('mosquitto', path=os.environ['PATH'] + ':/usr/sbin')
    if not program:
        raise Skip('mosquitto is not installed')
    pathlib.Path('mosquitto.conf').write_text(f'listener {port} 127.0.0.1\nallow_anonymous true\npersistence true\nuser root\n'
                                              f'persistence_location {os.getcwd()}/\n')
    broker = subprocess.Popen([program, '-c', 'mosquitto.conf'], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    for _ in range(100):
        try:
            socket.create_connection(('127.0.0.1', port), 0.2).close()
            return broker
        except OSError:
            time.sleep(0.05)
    raise AssertionError('the broker does not start')


def end(process):
    if process.poll() is None:
        process.terminate()
    process.wait(20)


class Subscriber:
    """mosquitto_sub into a file, started again when the broker comes back."""

    def __init__(self, port):
        self.port = port
        self.file = open('received', 'ab')
        self.start()

    def start(self):
        self.process = subprocess.Popen(
            ['stdbuf', '-oL', 'mosquitto_sub', '-h', '127.0.0.1', '-p', str(self.port), '-q', '1', '-t', 'rover/#', '-i', 'ground', '-c',
             '-d'], stdout=self.file, stderr=subprocess.DEVNULL)
        deadline = time.monotonic() + 10
        self.file.flush()
        while b'Subscribed' not in pathlib.Path('received').read_bytes()[self.seen():]:
            assert time.monotonic() < deadline, 'no subscription'
            time.sleep(0.05)
        self.mark = pathlib.Path('received').stat().st_size

    def seen(self):
        return getattr(self, 'mark', 0)

    def lines(self):
        return [line for line in pathlib.Path('received').read_text().splitlines() if line.startswith('{')]


def publish(port, *arguments, stdin=subprocess.PIPE):
    return subprocess.Popen([PYTHON, str(EXAMPLES / 'python/mqtt_publish.py'), '--port', str(port), '--topic', 'rover/terrain',
                             '--spool', 'spool', '--retry', '0.2', *arguments], stdin=stdin, stderr=subprocess.PIPE)


@case
def mqtt_carries_every_line(folder):
    lines = reference_lines('terrainscenesrc num-buffers=60 ! video/x-raw,width=160,height=96')
    port = free_port()
    broker = start_broker(port)
    subscriber = Subscriber(port)
    try:
        pipeline = subprocess.Popen(
            'gst-launch-1.0 -q terrainscenesrc num-buffers=60 ! video/x-raw,width=160,height=96 ! terrainseg ! '
            'terrainextract ! application/x-ndjson ! fdsink'.split(), stdout=subprocess.PIPE)
        publisher = publish(port, stdin=pipeline.stdout)
        pipeline.stdout.close()
        _, text = publisher.communicate(timeout=60)
        equal(publisher.returncode, 0, text.decode())
        deadline = time.monotonic() + 10
        while len(subscriber.lines()) < 60 and time.monotonic() < deadline:
            time.sleep(0.1)
        equal([json.loads(line) for line in subscriber.lines()], lines, 'lines')
        assert not os.path.exists('spool') and not os.path.exists('spool.done')
    finally:
        for process in pipeline, publisher, subscriber.process, broker:
            end(process)


@case
def mqtt_loses_nothing_when_the_broker_restarts(folder):
    port = free_port()
    broker = start_broker(port)
    subscriber = Subscriber(port)
    publisher = publish(port)
    try:
        def send(numbers):
            for number in numbers:
                publisher.stdin.write(b'{"frame": %d}\n' % number)
                publisher.stdin.flush()
                time.sleep(0.004)

        send(range(0, 100))
        deadline = time.monotonic() + 10
        while len(subscriber.lines()) < 100 and time.monotonic() < deadline:
            time.sleep(0.05)
        end(subscriber.process)
        end(broker)
        send(range(100, 300))  # nobody is there
        assert os.path.getsize('spool') > 0
        broker = start_broker(port)
        send(range(300, 400))
        publisher.stdin.close()
        publisher.wait(30)
        equal(publisher.returncode, 0, 'exit code')
        subscriber.start()  # its session was kept by the broker
        while len(subscriber.lines()) < 400 and time.monotonic() < deadline + 20:
            time.sleep(0.05)
        frames = sorted({json.loads(line)['frame'] for line in subscriber.lines()})
        equal(frames, list(range(400)), 'frames')
        text = publisher.stderr.read().decode()
        contains(text, '400 lines delivered, 0 dropped')
        contains(text, 'lines wait for the broker')
    finally:
        for process in publisher, subscriber.process, broker:
            end(process)


@case
def mqtt_goes_on_after_being_killed(folder):
    port = free_port()
    publisher = publish(port)  # no broker at all
    for number in range(50):
        publisher.stdin.write(b'{"frame": %d}\n' % number)
    publisher.stdin.write(b'{"frame": 50')  # killed in the middle of a line
    publisher.stdin.flush()
    deadline = time.monotonic() + 10
    while (not os.path.exists('spool') or pathlib.Path('spool').read_bytes().count(b'\n') < 50) and \
            time.monotonic() < deadline:
        time.sleep(0.05)
    publisher.kill()
    publisher.wait()
    with open('spool', 'ab') as spool:
        spool.write(b'{"half')
    broker = start_broker(port)
    subscriber = Subscriber(port)
    try:
        publisher = publish(port, stdin=subprocess.DEVNULL)
        publisher.wait(30)
        deadline = time.monotonic() + 10
        while len(subscriber.lines()) < 50 and time.monotonic() < deadline:
            time.sleep(0.05)
        equal([json.loads(line)['frame'] for line in subscriber.lines()], list(range(50)), 'frames')
    finally:
        for process in publisher, subscriber.process, broker:
            end(process)


@case
def mqtt_limits_its_spool_and_says_so(folder):
    port = free_port()
    publisher = publish(port, '--limit', '20')
    for number in range(100):
        publisher.stdin.write(b'{"frame": %d}\n' % number)
    publisher.stdin.close()
    time.sleep(0.5)
    broker = start_broker(port)
    try:
        publisher.wait(30)
        equal(publisher.returncode, 1, 'exit code')
        contains(publisher.stderr.read().decode(), '20 lines delivered, 80 dropped')
    finally:
        for process in publisher, broker:
            end(process)


def rtsp(folder, protocol, *arguments):
    if not os.environ['RTSP_SERVER']:
        raise Skip('built without gstreamer-rtsp-server-1.0')
    source = 'terrainscenesrc is-live=true num-buffers=75 ! video/x-raw,width=160,height=96,framerate=30/1'
    server = subprocess.Popen([os.environ['RTSP_SERVER'], '--port', str(port := free_port()), '--source', source, *arguments],
                              stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        equal(server.stdout.readline().strip(), f'rtsp://127.0.0.1:{port}/rover', 'address')
        launch(f'rtspsrc location=rtsp://127.0.0.1:{port}/rover protocols={protocol} name=r '
               'r. ! application/x-rtp,media=video ! rtph264depay ! h264parse ! avdec_h264 ! c.sink '
               'r. ! application/x-rtp,media=application ! rtpklvdepay ! c.meta '
               'terraincombine name=c ! terrainextract ! application/x-ndjson ! filesink location=received.jsonl')
        closed = server.stdout.readline()
        frames, units = map(int, re.match(r'media closed: (\d+) frames and (\d+) units', closed).groups())
        lines = [json.loads(line) for line in open('received.jsonl')]
        assert frames == units and frames >= 40, closed
        equal(len(lines), frames, 'frames that came with their metadata')
        equal([line['frame'] for line in lines], list(range(frames)), 'frame numbers')
        assert all((line['width'], line['height']) == (160, 96) for line in lines)
        assert len({line['traversable'] for line in lines}) > 5, 'they are estimates, not one value'
    finally:
        end(server)


@case
def rtsp_over_tcp(folder):
    rtsp(folder, 'tcp')


@case
def rtsp_over_udp_annotated(folder):
    rtsp(folder, 'udp', '--annotated')


@case
def rtsp_refuses_what_it_cannot_do(folder):
    if not os.environ['RTSP_SERVER']:
        raise Skip('built without gstreamer-rtsp-server-1.0')
    contains(run(os.environ['RTSP_SERVER'], '--no-such', code=2).stderr, 'no-such')
    with socket.socket() as taken:
        taken.bind(('0.0.0.0', 0))
        taken.listen()
        contains(run(os.environ['RTSP_SERVER'], '--port', taken.getsockname()[1], code=1).stderr, 'in use')


def self_test(name):
    def test(folder):
        text = run(EXAMPLES / f'{name}.sh', '--self-test').stdout
        contains(text, f'{name}.sh: ')
    test.__name__ = name
    return case(test)


for script in 'camera', 'file', 'compare', 'stream_udp_ts', 'stream_srt', 'stream_rtp':
    self_test(script)


@case
def scripts_explain_themselves(folder):
    for script in EXAMPLES.glob('*.sh'):
        if script.name != 'common.sh':
            contains(run(script, '--help').stdout, f'usage: examples/{script.name}')


@case
def make_pictures_makes_every_picture(folder):
    run(EXAMPLES / 'make_pictures.sh', folder / 'pictures', env={**os.environ, 'MAX_FRAMES': '2'})
    made = {path.name: path.read_bytes() for path in (folder / 'pictures').iterdir()}
    committed = {path.name for path in (EXAMPLES.parent / 'docs' / 'images').glob('*.jpg')}
    equal(sorted(set(made) - committed), [], 'pictures that are made but not in docs/images')
    assert len(made) >= 15, sorted(made)
    for name, content in made.items():
        assert content[:2] == b'\xff\xd8' and content[-2:] == b'\xff\xd9', f'{name} is no JPEG file'
        assert 2000 < len(content) < 200000, f'{name} has {len(content)} bytes'


if __name__ == '__main__':
    main(CASES)
