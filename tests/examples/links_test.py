#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""The examples that measure real time: brokers, streams, an autopilot, a link that loses. RTSP_SERVER is the built program, or empty."""
import collections
import json
import math
import os
import pathlib
import pty
import re
import select
import shutil
import signal
import socket
import struct
import subprocess
import time
import tty

from example_runs import EXAMPLES, PYTHON, launch, module, reference_lines, run, scene
from ports import free_port, free_udp_block
from tap import Skip, contains, equal, main

CASES = []


def case(function):
    CASES.append(function)
    return function


def self_test(name):
    def test(folder):
        text = run(EXAMPLES / f'{name}.sh', '--self-test').stdout
        contains(text, f'{name}.sh: ')
    test.__name__ = name
    return case(test)


for script in 'stream_udp_ts', 'stream_srt', 'stream_rtp', 'ardupilot', 'camera', 'file', 'compare':  # the longest cases begin first
    self_test(script)


@case
def steering_stops_when_no_picture_comes(folder):
    lines = run(PYTHON, EXAMPLES / 'python/steer.py', '--settings', '! identity sleep-time=800000',
                scene('drive.mp4', frames=4)).stdout.splitlines()
    equal(sum(line.startswith('frame') for line in lines), 4, 'commands')
    assert lines.count('stop: no picture') >= 3, lines


@case
def steering_stops_when_the_link_loses_metadata(folder):
    """Every tenth unit is missing: no frame without one, and none shortly after, is steered by."""
    launch('terrainscenesrc num-buffers=60 ! video/x-raw,format=I420,width=160,height=120 ! terrainseg ! tee name=t '
           't. ! queue ! x264enc tune=zerolatency ! h264parse ! queue ! mux. '
           't. ! queue ! terrainextract ! meta/x-klv,parsed=true ! queue ! mux. '
           'mpegtsmux name=mux ! filesink location=drive.ts')
    link = ('filesrc location=drive.ts ! tsdemux name=d d. ! queue ! h264parse ! avdec_h264 ! link.sink '
            'd. ! queue ! meta/x-klv ! identity drop-probability={} ! link.meta terraincombine name=link')

    def commands(loss):
        lines = run(PYTHON, EXAMPLES / 'python/steer.py', '--link', link.format(loss)).stdout.splitlines()
        lines = [line for line in lines if line != 'stop: no picture']
        equal(len(lines), 60, 'commands')
        return lines
    assert not any('stale' in line for line in commands(0)), 'nothing is lost'
    lines = commands(0.1)
    without = [line for line in lines if line.startswith('frame - ')]
    assert len(without) >= 1 and all('stop: stale' in line for line in without), lines
    behind = [lines[i + 1] for i, line in enumerate(lines[:-1]) if line.startswith('frame - ')]
    assert all('stop: stale' in line for line in behind), behind


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
        assert re.search(r'lines? waits? for the broker', text), text
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
               'r. ! application/x-rtp,media=video ! rtph264depay ! h264parse ! terrainstamp mode=read ! avdec_h264 ! c.sink '
               'r. ! application/x-rtp,media=application ! rtpklvdepay ! c.meta '
               'terraincombine name=c ! terrainextract ! application/x-ndjson ! filesink location=received.jsonl')
        closed = server.stdout.readline()
        frames, units = map(int, re.match(r'media closed: (\d+) frames and (\d+) units', closed).groups())
        lines = [json.loads(line) for line in open('received.jsonl')]
        assert frames == units and frames >= 40, closed
        # On a busy machine the goodbye may overtake the last frame (rtspsrc ends with it), or UDP lose one; no more may be lost.
        numbers = [line['frame'] for line in lines]
        assert len(lines) >= frames - 1, f'{len(lines)} of {frames} frames came with their metadata'
        assert numbers == sorted(set(numbers)) and set(numbers) <= set(range(frames)), f'frame numbers: {numbers}'
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
    contains(run(os.environ['RTSP_SERVER'], '--port', '99999', code=2).stderr, '99999')
    with socket.socket() as taken:
        taken.bind(('0.0.0.0', 0))
        taken.listen()
        contains(run(os.environ['RTSP_SERVER'], '--port', taken.getsockname()[1], code=1).stderr, 'in use')
    bare = {**os.environ, 'GST_PLUGIN_SYSTEM_PATH': str(folder), 'GST_REGISTRY': str(folder / 'registry')}
    contains(run(os.environ['RTSP_SERVER'], code=3, env=bare).stderr, 'gstreamer1.0-plugins-ugly')
    contains(run(os.environ['RTSP_SERVER'], code=3, env={**bare, 'GST_PLUGIN_PATH': ''}).stderr, 'terrainseg: install it')


@case
def rtsp_says_why_there_is_no_picture(folder):
    server = os.environ['RTSP_SERVER']
    if not server:
        raise Skip('built without gstreamer-rtsp-server-1.0')
    absent = run(server, '--source', 'v4l2src device=/dev/no-such-camera ! decodebin', code=4).stderr
    contains(absent, "Cannot identify device '/dev/no-such-camera'")
    contains(absent, '--source ')
    contains(run(server, '--source', 'nosuchsrc', code=4).stderr, 'no element "nosuchsrc"')
    contains(run(server, '--source', 'videotestsrc', '--settings', 'no-such=1', code=4).stderr, 'no property "no-such"')
    # GStreamer only warns of a value that cannot be, and goes on with the default.
    contains(run(server, '--source', 'videotestsrc', '--settings', 'caution=101', code=4).stderr, "the pipeline cannot be built: value \"101\"")
    # Names in the user's own language; the pipeline is asked for, not the locale.
    contains(run(server, '--source', 'v4l2src device=/dev/kamera-ä', code=4, env={**os.environ, 'LC_ALL': 'C.UTF-8'}).stderr, 'kamera-ä')
    # What shows only when a viewer comes.
    for source, cause in (('filesrc location=absent.mp4 ! decodebin', 'No such file "'),
                          ('videotestsrc ! video/x-raw,interlace-mode=interleaved', 'put "deinterlace" before it')):
        process = subprocess.Popen([server, '--port', str(port := free_port()), '--source', source], stdout=subprocess.PIPE,
                                   stderr=subprocess.PIPE, text=True)
        try:
            process.stdout.readline()
            viewer = run('gst-launch-1.0', '-q', 'rtspsrc', f'location=rtsp://127.0.0.1:{port}/rover', '!', 'fakesink', code=1)
            contains(viewer.stderr, '503')
        finally:
            process.send_signal(signal.SIGINT)
            said = process.communicate(timeout=30)[1]
        contains(said, cause)
        equal(said.count('rtsp_server: error'), 1, said)


@case
def rtsp_asks_for_a_password(folder):
    server = os.environ['RTSP_SERVER']
    if not server:
        raise Skip('built without gstreamer-rtsp-server-1.0')
    contains(run(server, '--address', '0.0.0.0', code=2).stderr, 'RTSP_PASSWORD')
    contains(run(server, env={**os.environ, 'RTSP_USER': 'me'}, code=2).stderr, 'both')
    process = subprocess.Popen(
        [server, '--port', str(port := free_port()), '--source', 'terrainscenesrc is-live=true ! video/x-raw,width=160,height=96'],
        stdout=subprocess.PIPE, text=True, env={**os.environ, 'RTSP_USER': 'me', 'RTSP_PASSWORD': 'secret'})
    try:
        process.stdout.readline()
        # 127.0.0.2 is this machine too: who listens on 127.0.0.1 alone does not answer there.
        with socket.socket() as other:
            assert other.connect_ex(('127.0.0.2', port)) != 0, 'it listens on 127.0.0.1 alone'
        watch = ('gst-launch-1.0 -q rtspsrc protocols=tcp location=rtsp://{}127.0.0.1:{}/rover ! rtph264depay ! identity eos-after=5 '
                 '! filesink location=seen.h264')
        for wrong in '', 'me:wrong@':
            contains(run(*watch.format(wrong, port).split(), code=1).stderr, 'nauthorized')
            equal(os.path.getsize('seen.h264'), 0, 'bytes without the password')
        # The video decides, not the exit code: rtspsrc 1.26 may complain of the connection that it closes itself.
        subprocess.run(watch.format('me:secret@', port).split(), stderr=subprocess.DEVNULL, timeout=60)
        assert os.path.getsize('seen.h264') > 0, 'nothing came with the right password'
    finally:
        end(process)


def crc_of(data):
    """CRC-16/MCRF4XX bit by bit, apart from the example's."""
    crc = 0xFFFF
    for byte in data:
        for bit in range(8):
            crc = crc >> 1 ^ (0x8408 if (crc ^ byte >> bit) & 1 else 0)
    return crc


def attitude_frame(roll, pitch, component=1, second=True):
    payload = struct.pack('<I6f', 1000, roll, pitch, 1.5, 0, 0, 0)
    if second:
        payload = payload.rstrip(b'\0')
        body = bytes([len(payload), 0, 0, 7, 1, component, 30, 0, 0]) + payload
    else:
        body = bytes([len(payload), 7, 1, component, 30]) + payload
    return (b'\xfd' if second else b'\xfe') + body + crc_of(body + b'\x27').to_bytes(2, 'little')


@case
def attitude_is_read_and_its_signs_turn(folder):
    example = module('attitude_to_pose')
    for second in (True, False):
        frame = attitude_frame(0.1, -0.2, second=second)
        found, = example.attitudes(b'\x00\xfd\x20' + frame)
        assert all(abs(a - b) < 1e-6 for a, b in zip(found, (0.1, -0.2, 1.5))), found
        for i in range(1, len(frame)):
            damaged = frame[:i] + bytes([frame[i] ^ 0x10]) + frame[i + 1:]
            equal(list(example.attitudes(damaged)), [], f'damaged at {i}')
            equal(list(example.attitudes(frame[:i])), [], f'cut at {i}')
    equal(list(example.attitudes(attitude_frame(0.1, 0.2, component=154))), [], "a gimbal's")
    mount = example.parse_mount('height=0.5, pitch=10deg')
    # Nose down: the camera looks down by as much more. Right side down stays right side down.
    for (roll, pitch), (want_roll, want_pitch) in {(0, -0.1): (0, 0.1 + mount['pitch']), (0, 0.1): (0, mount['pitch'] - 0.1)}.items():
        got = example.camera_pose(roll, pitch, mount)
        assert abs(got[0] - want_roll) < 1e-9 and abs(got[1] - want_pitch) < 1e-9, got
    got = example.camera_pose(0.2, -0.1, {})
    assert abs(got[0] - 0.2) < 1e-9 and abs(got[1] - 0.1) < 1e-9, got
    # A camera that looks to the left (yaw +90 degrees) of a vehicle that rolls right looks up.
    got = example.camera_pose(0.2, 0, {'yaw': 1.5707963267948966})
    assert abs(got[1] + 0.2) < 1e-9 and abs(got[0]) < 1e-9, got


@case
def attitude_moves_the_metres(folder):
    with socket.socket(type=socket.SOCK_DGRAM) as heard, socket.socket(type=socket.SOCK_DGRAM) as said:
        heard.bind(('127.0.0.1', 0))
        heard.settimeout(0.02)
        port = free_port()
        sender = subprocess.Popen([EXAMPLES / 'ardupilot.sh', '--scene', f'127.0.0.1:{heard.getsockname()[1]}'],
                                  env={**os.environ, 'ATTITUDE': f'127.0.0.1:{port}'})
        nearest = []
        try:
            while sender.poll() is None:
                said.sendto(attitude_frame(0, -0.35), ('127.0.0.1', port))  # nose down
                try:
                    data = heard.recv(2048)
                except TimeoutError:
                    continue
                if data[7:10] == b'\0\0\0':
                    data = data[12 + data[1]:]
                if data:
                    nearest.append(int.from_bytes(data[162:164], 'little'))
        finally:
            sender.kill()
        equal(sender.wait(), 0, 'exit')
        # 1.35 m high, looking down by 2.75 degrees and 0.35; the lowest row is 90 below the middle, 262.4 to a radian. The least
        # distance holds for the whole stream: it leaves 10 degrees for the vehicle's sway.
        expected = 135 / math.tan(math.radians(2.75 + 10) + 0.35 + math.atan(90 / 262.4))
        near = [n for n in nearest if abs(n - expected) < 4]
        assert len(near) > 20, (expected, nearest)


RTP_CLOCK = """
import datetime, json, sys, time
import gi
gi.require_version('Gst', '1.0')
from gi.repository import Gst
Gst.init(None)
port = int(sys.argv[1])
video = 'terrainscenesrc is-live=true num-buffers=90 ! video/x-raw,format=I420,width=160,height=96,framerate=15/1'
sender = Gst.parse_launch(f'''rtpbin name=r ntp-time-source=ntp
  {video} ! identity name=taken ! x264enc tune=zerolatency key-int-max=5 speed-preset=ultrafast ! h264parse config-interval=-1 ! rtph264pay ! r.send_rtp_sink_0
  r.send_rtp_src_0 ! udpsink host=127.0.0.1 port={port} sync=false async=false
  r.send_rtcp_src_0 ! udpsink host=127.0.0.1 port={port + 1} sync=false async=false''')
session = sender.get_by_name('r').emit('get-internal-session', 0)
session.set_property('rtcp-min-interval', 100 * Gst.MSECOND)
session.set_property('rtcp-fraction', 10000.0)
receiver = Gst.parse_launch(f'''rtpbin name=r latency=100 add-reference-timestamp-meta=true
  udpsrc address=127.0.0.1 port={port} caps="application/x-rtp,media=video,clock-rate=90000,encoding-name=H264,payload=96" ! r.recv_rtp_sink_0
  udpsrc address=127.0.0.1 port={port + 1} ! r.recv_rtcp_sink_0
  r. ! application/x-rtp,media=video ! rtph264depay ! h264parse ! avdec_h264 ! terrainseg ! terrainextract ! application/x-ndjson ! appsink name=lines sync=false''')
taken = []
def note(pad, info):
    taken.append(time.time())
    return Gst.PadProbeReturn.OK
sender.get_by_name('taken').get_static_pad('src').add_probe(Gst.PadProbeType.BUFFER, note)
receiver.set_state(Gst.State.PLAYING)
time.sleep(0.3)
sender.set_state(Gst.State.PLAYING)
told = []
while sample := receiver.get_by_name('lines').emit('try-pull-sample', 3 * Gst.SECOND):
    buffer = sample.get_buffer()
    told.append(json.loads(buffer.extract_dup(0, buffer.get_size())).get('utc'))
sender.set_state(Gst.State.NULL)
receiver.set_state(Gst.State.NULL)
known = [datetime.datetime.fromisoformat(each.replace('Z', '+00:00')).timestamp() for each in told if each]
print(json.dumps({'frames': len(told), 'known': len(known), 'off': [min(abs(each - at) for at in taken) for each in known],
                  'steps': [b - a for a, b in zip(known, known[1:])]}))
"""


@case
def rtp_tells_the_time_of_day(folder):
    pathlib.Path('clock.py').write_text(RTP_CLOCK)
    result = json.loads(run(PYTHON, 'clock.py', free_udp_block(2)).stdout)
    assert result['known'] >= result['frames'] // 2 > 20, result
    # The instant at which the sender took the frame; a busy machine takes its own time between clock and note.
    off = sorted(result['off'])
    assert off[len(off) * 9 // 10] < 0.03, result
    assert all(step > 0 for step in result['steps']), result


@case
def mavlink_on_a_serial_line(folder):
    here, line = pty.openpty()
    tty.setraw(line)
    with subprocess.Popen(['gst-launch-1.0', '-q', 'terrainscenesrc', 'is-live=true', 'num-buffers=60', '!', 'video/x-raw,width=160,height=96,framerate=30/1', '!',
                           'terrainseg', '!', 'terrainextract', '!', 'application/x-mavlink', '!', 'filesink', f'location={os.ttyname(line)}', 'buffer-mode=unbuffered']) as sender:
        data = b''
        while sender.poll() is None or select.select([here], [], [], 0.2)[0]:
            if select.select([here], [], [], 0.2)[0]:
                data += os.read(here, 4096)
    equal(sender.returncode, 0, 'exit')
    messages = collections.Counter()
    while data:
        equal(data[0], 0xfd, 'a frame begins')
        messages[int.from_bytes(data[7:10], 'little')] += 1
        data = data[12 + data[1]:]
    assert 25 <= messages[330] <= 31 and messages[0] >= 2 and len(messages) == 2, messages


@case
def a_silent_autopilot_is_told(folder):
    program = [PYTHON, EXAMPLES / 'python/attitude_to_pose.py', '--listen', f'127.0.0.1:{free_port()}']
    source = 'terrainscenesrc is-live=true num-buffers={} ! video/x-raw,width=160,height=96,framerate=30/1 ! terrainseg ! fakesink'
    contains(run(*program, source.format(150)).stderr, 'no ATTITUDE of an autopilot')
    equal(run(*program, source.format(30)).stderr, '', 'one second')


@case
def a_warning_is_shown_once_and_the_log_is_not(folder):
    source = 'terrainscenesrc num-buffers=20 ! video/x-raw,width=160,height=96'
    plain = {key: value for key, value in os.environ.items() if not key.startswith('GST_DEBUG')}
    told = run(EXAMPLES / 'camera.sh', env={**plain, 'SOURCE': source, 'VIEW': 'fakesink', 'SETTINGS': 'window-bottom=5000'}).stderr.splitlines()
    equal([line[:58] for line in told], ['WARNING: from element terrainseg0: The training window (wi'], told)
    grey = 'terrainscenesrc num-buffers=200 ! video/x-raw,width=64,height=48 ! videobalance saturation=0'
    told = run(EXAMPLES / 'camera.sh', env={**plain, 'SOURCE': grey, 'VIEW': 'fakesink'}).stderr.splitlines()
    equal([line[:52] for line in told], ['WARNING: from element terrainseg0: The video format '], told)
    contains(run(EXAMPLES / 'ardupilot.sh', env={**plain, 'SOURCE': source}).stderr, 'The autopilot receives an obstacle in all directions')
    wrong = run(EXAMPLES / 'camera.sh', code=255, env={**plain, 'SOURCE': source, 'VIEW': 'fakesink', 'SETTINGS': 'camera-info=none.yaml mount=height=1'})
    equal(wrong.stderr.count('No such file'), 2, 'error and details of gst-launch-1.0')


@case
def the_ground_station_says_what_it_waits_for(folder):
    station = subprocess.Popen([EXAMPLES / 'ground_station.sh', f'udp://:{free_port()}'], stderr=subprocess.PIPE, text=True,
                               env={**os.environ, 'VIEW': 'fakesink'})
    try:
        contains(station.stderr.readline(), 'video and KLV from udp://:')
    finally:
        end(station)


if __name__ == '__main__':
    # Three keep the processors busy for a quarter of their time. RTSP gives frames up that are not fetched at once.
    main(CASES, at_once=3, alone=(rtsp_over_tcp, rtsp_over_udp_annotated, rtsp_says_why_there_is_no_picture))
