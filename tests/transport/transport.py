#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""usage: transport.py file|file-bframes|file-after-encoder|udp-loss|udp-restart|srt|rtp-ts|rtp-klv|mavlink-unheard

A rover's pipeline and a ground station's on loopback, with real elements in between. Frames and units are counted at
both ends, and each frame's line (mask, boundary, horizon, models) on the ground must be the one on the rover."""
import datetime
import json
import os
import random
import subprocess
import sys
import tempfile
import threading
import time
import traceback

import gi

gi.require_version('Gst', '1.0')
from gi.repository import Gst  # noqa: E402

TESTS = os.path.join(os.path.dirname(os.path.abspath(__file__)), '..')
sys.path[:0] = [TESTS, os.path.join(TESTS, 'unit')]
import klv_decoder  # noqa: E402
from ports import free_udp_block  # noqa: E402

FRAMES = 100
START = '2026-11-22T20:00:00Z'  # time of day of the rover's PTS 0
RATE = 50
TIMEOUT = 25  # seconds for a whole run, of which a quiet machine takes 3 to 5
ENCODER = 'x264enc tune=zerolatency key-int-max=10 speed-preset=ultrafast ! h264parse config-interval=-1'
LINES = 'terrainextract json-mask=true ! application/x-ndjson'
GROUND = ('terraincombine name=combine ! queue ! ' + LINES + ' ! appsink name=lines sync=false '
          'max-buffers=1000')


def source(live, rate=RATE):
    src = 'terrainscenesrc' if Gst.ElementFactory.find('terrainscenesrc') else 'videotestsrc pattern=ball'
    return (f'{src} num-buffers={FRAMES} is-live={str(live).lower()} ! '
            f'video/x-raw,format=I420,width=320,height=240,framerate={rate}/1 ! terrainseg start-time={START} ! tee name=t '
            f't. ! queue ! {LINES} ! appsink name=lines sync=false max-buffers=1000 ')


def rover_ts(live, sink, encoder=ENCODER):
    return (source(live) + f't. ! queue ! {encoder} ! queue ! mux. '
            't. ! queue ! terrainextract ! meta/x-klv,parsed=true ! queue ! mux. '
            f'mpegtsmux name=mux alignment=7 {"latency=100000000" if live else ""} ! {sink}')


def rover_ts_after_encoder(sink):
    """The units are taken from encoded frames, in coding order."""
    return (source(False) + 't. ! queue ! x264enc bframes=2 b-adapt=false key-int-max=25 ! h264parse ! tee name=e '
            'e. ! queue ! mux. e. ! queue ! terrainextract ! meta/x-klv,parsed=true ! queue ! mux. '
            f'mpegtsmux name=mux alignment=7 ! {sink}')


def check_with_ffmpeg(path):
    """Another demuxer and another decoder: what ffmpeg takes out of the file are the units, whole and in order."""
    data = subprocess.run(['ffmpeg', '-v', 'error', '-i', path, '-map', '0:d:0', '-c', 'copy', '-f', 'data', '-'],
                          capture_output=True, check=True).stdout
    frames = []
    while data:
        length, start = klv_decoder.ber(data, 16)
        frames.append(klv_decoder.decode(data[:start + length])['frame'])
        data = data[start + length:]
    return report(sorted(frames) == list(range(FRAMES)), f'ffmpeg takes {len(frames)} units out of the file')


class Pipeline:
    def __init__(self, description):
        self.pipeline = Gst.parse_launch(description)
        self.lines = []
        self.counts = {}
        sink = self.pipeline.get_by_name('lines')
        sink.set_property('emit-signals', True)
        sink.connect('new-sample', self.take_line)
        self.last_activity = time.monotonic()

    def take_line(self, sink):
        buffer = sink.emit('pull-sample').get_buffer()
        self.lines.append(json.loads(buffer.extract_dup(0, buffer.get_size())))
        self.last_activity = time.monotonic()
        return Gst.FlowReturn.OK

    def count(self, element, pad):
        """Counts the buffers on a pad."""
        name = f'{element}.{pad}'
        self.counts[name] = 0

        def probe(_pad, _info):
            self.counts[name] += 1
            self.last_activity = time.monotonic()
            return Gst.PadProbeReturn.OK
        self.pipeline.get_by_name(element).get_static_pad(pad).add_probe(Gst.PadProbeType.BUFFER, probe)

    def play(self):
        if self.pipeline.set_state(Gst.State.PLAYING) == Gst.StateChangeReturn.FAILURE:
            self.check(0)
            raise SystemExit('does not start')

    def check(self, seconds):
        """Waits for the end; an error is one. True when the end came."""
        message = self.pipeline.get_bus().timed_pop_filtered(
            int(seconds * Gst.SECOND), Gst.MessageType.EOS | Gst.MessageType.ERROR)
        if message and message.type == Gst.MessageType.ERROR:
            raise SystemExit(f'error: {message.parse_error()}')
        return message is not None

    def stats(self):
        s = self.pipeline.get_by_name('combine').get_property('stats')
        return {name: s.get_uint64(name).value for name in ('matched', 'matched-precisely', 'lost', 'rejected', 'unused')}

    def stop(self):
        self.pipeline.set_state(Gst.State.NULL)


class Loss:
    """Drops datagrams of seven TS packets and knows which KLV units and video frames they took along."""

    def __init__(self, pad, share, seed):
        self.random = random.Random(seed)
        self.share = share
        self.pids = {}
        self.units = {}    # PID -> units begun
        self.lost = {}     # PID -> numbers of units with a lost packet
        self.seen = self.dropped = 0
        pad.add_probe(Gst.PadProbeType.BUFFER | Gst.PadProbeType.BUFFER_LIST, self.probe)

    def account(self, data, lost):
        for at in range(0, len(data), 188):
            packet = data[at:at + 188]
            assert packet[0] == 0x47 and len(packet) == 188
            pid = (packet[1] & 0x1f) << 8 | packet[2]
            if not packet[3] & 0x10:
                continue
            if packet[1] & 0x40:
                self.units[pid] = self.units.get(pid, 0) + 1
            if lost:
                self.lost.setdefault(pid, set()).add(self.units.get(pid, 0) - 1)

    def probe(self, _pad, info):
        buffers = info.get_buffer_list() if info.type & Gst.PadProbeType.BUFFER_LIST else None
        whole = [buffers.get(i) for i in range(buffers.length())] if buffers else [info.get_buffer()]
        self.seen += 1
        # The tables at the very start may come through: without them a receiver waits for the next ones.
        drop = self.seen > 10 and self.random.random() < self.share
        for b in whole:
            self.account(b.extract_dup(0, b.get_size()), drop)
        self.dropped += drop
        return Gst.PadProbeReturn.DROP if drop else Gst.PadProbeReturn.OK


def comparable(line):
    return {k: v for k, v in line.items() if k != 'pts'}


def report(ok, text):
    print(('ok   ' if ok else 'FAIL ') + text)
    return ok


def tells_the_time(line):
    """The time of day is that of the start and the time stamp, to the microsecond."""
    start = datetime.datetime.fromisoformat(START.replace('Z', '+00:00'))
    told = datetime.datetime.fromisoformat(line['utc'].replace('Z', '+00:00'))
    return told - start == datetime.timedelta(microseconds=line['pts'] // 1000)


def judge(rover, ground, lost_units=frozenset(), frames_may_be_lost=False, settling=0):
    """`settling`: frames at the start that need not meet their units, because two RTP streams are not in step yet. On a
    busy machine they get out of step later too, as rtpbin follows the arrival times: one in ten may."""
    sent = {line['frame']: comparable(line) for line in rover.lines}
    got = [comparable(line) for line in ground.lines]
    frames = ground.counts['combine.sink']
    units = ground.counts['combine.meta']
    stats = ground.stats()
    print(f'sent {len(sent)} frames; ground: {frames} frames, {units} units, {stats}')
    good = report(len(sent) == FRAMES, f'{FRAMES} frames left the rover')
    good &= report(all(tells_the_time(line) for line in rover.lines), 'the rover tells the time of day')
    good &= report(all(sent.get(line['frame']) == line for line in got),
                   'every line on the ground is the rover\'s of that frame: time of day, mask, horizon, boundary, models')
    numbers = [line['frame'] for line in got]
    good &= report(numbers == sorted(set(numbers)), f'in order, none twice {[(n, m) for n, m in zip(numbers, numbers[1:]) if m <= n]}')
    good &= report(stats['matched'] == len(got), 'as many lines as matches')
    good &= report(stats['matched'] + stats['lost'] == frames == ground.counts['combine.src'],
                   'every frame that came in went out')
    masks = {json.dumps(line['mask']) for line in sent.values()}
    good &= report(len(masks) > FRAMES // 4, f'{len(masks)} different masks: the check can fail')
    if not frames_may_be_lost:
        good &= report(frames == FRAMES and units == FRAMES and stats['rejected'] == 0, 'nothing is missing')
        without = set(range(settling, FRAMES)) - set(numbers)
        good &= report(len(without) <= (FRAMES // 10 if settling else 0), f'every frame from number {settling} on has its unit {sorted(without) or ""}')
    else:
        missing = set(sent) - set(numbers)
        good &= report(bool(lost_units), f'{len(lost_units)} units were lost on the way')
        good &= report(not set(numbers) & lost_units, 'no unit came that was lost')
        arrived = FRAMES - len(lost_units)
        good &= report(stats['matched'] + stats['unused'] >= arrived - 2,
                       f'{arrived} units came through, {stats["matched"]} met their frame, '
                       f'{stats["unused"]} lost theirs')
        good &= report(len(missing) < FRAMES // 2, f'{len(missing)} frames without metadata')
    return good


def run(rover, ground, finish):
    """Both ends until everything has arrived. `finish` ends the ground's stream."""
    end = time.monotonic() + TIMEOUT
    for name in ('sink', 'meta', 'src'):
        ground.count('combine', name)
    ground.play()
    time.sleep(0.3)
    rover.play()
    # Not until EOS: the RTCP sinks of an rtpbin never see one.
    while time.monotonic() < end and len(rover.lines) < FRAMES:
        rover.check(0.05)
    while time.monotonic() < end and time.monotonic() - ground.last_activity < 0.7:
        time.sleep(0.05)
    finish()
    if not ground.check(max(end - time.monotonic(), 1)):
        raise SystemExit('the ground does not come to its end')


def end_sources(pipeline):
    """EOS behind the network's end, so that demuxer and decoder give what they hold. From its pad and not sent to
    the element: srtsrc 1.22 does not return from that while it waits for data."""
    def finish():
        iterator = pipeline.pipeline.iterate_sources()
        while True:
            result, element = iterator.next()
            if result != Gst.IteratorResult.OK:
                return
            element.get_static_pad('src').push_event(Gst.Event.new_eos())
    return finish


def both(rover_text, ground_text, loss=None, settling=0, prepare=None):
    rover, ground = Pipeline(rover_text), Pipeline(ground_text)
    link = loss and Loss(rover.pipeline.get_by_name('mux').get_static_pad('src'), *loss)
    if prepare:
        prepare(rover)
    try:
        run(rover, ground, end_sources(ground))
        if not link:
            return judge(rover, ground, settling=settling)
        klv = [pid for pid, n in link.units.items() if n == FRAMES]
        print(f'{link.dropped} of {link.seen} datagrams dropped, units by PID {link.units}')
        # Video and units have as many PES each; the units' PID is the one that mpegtsmux gave the second pad.
        return judge(rover, ground, link.lost.get(max(klv), frozenset()), True)
    finally:
        rover.stop()
        ground.stop()


def demux(reader=''):
    """`reader`: what stands in front of the decoder."""
    return (f'tsdemux name=d d. ! queue ! h264parse {reader}! avdec_h264 ! combine.sink '
            'd. ! meta/x-klv ! queue ! combine.meta ' + GROUND)


DEMUX = demux()


def ts_file(make_rover):
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, 'rover.ts')
        rover = Pipeline(make_rover(f'filesink location={path}'))
        rover.play()
        if not rover.check(TIMEOUT):
            raise SystemExit('the rover does not come to its end')
        streams = subprocess.run(['ffprobe', '-v', 'error', '-show_entries', 'stream=codec_name', '-of', 'csv=p=0', path],
                                 capture_output=True, text=True, check=True).stdout.split()
        good = report(set(streams) == {'h264', 'klv'}, f'ffprobe lists {set(streams)}')
        good &= check_with_ffmpeg(path)
        # With queues, and as a short pipeline writes it, one thread for both streams.
        for demux in (DEMUX, 'tsdemux name=d d. ! h264parse ! avdec_h264 ! combine.sink '
                             'd. ! meta/x-klv ! combine.meta ' + GROUND):
            ground = Pipeline(f'filesrc location={path} ! {demux}')
            for name in ('sink', 'meta', 'src'):
                ground.count('combine', name)
            ground.play()
            if not ground.check(TIMEOUT):
                raise SystemExit('the ground does not come to its end')
            good &= judge(rover, ground)
            ground.stop()
        rover.stop()
        return good


def rtp_klv():
    port = free_udp_block()
    rover = source(True, 25) + (
        f'rtpbin name=rtp '
        f't. ! queue ! {ENCODER} ! rtph264pay pt=96 ! rtp.send_rtp_sink_0 '
        't. ! queue ! terrainextract ! meta/x-klv,parsed=true ! rtpklvpay pt=97 ! rtp.send_rtp_sink_1 '
        f'rtp.send_rtp_src_0 ! udpsink host=127.0.0.1 port={port} sync=false async=false '
        f'rtp.send_rtcp_src_0 ! udpsink host=127.0.0.1 port={port + 1} sync=false async=false '
        f'rtp.send_rtp_src_1 ! udpsink host=127.0.0.1 port={port + 2} sync=false async=false '
        f'rtp.send_rtcp_src_1 ! udpsink host=127.0.0.1 port={port + 3} sync=false async=false ')
    ground = (
        'rtpbin name=rtp latency=100 '
        f'udpsrc port={port} address=127.0.0.1 caps="application/x-rtp,media=video,clock-rate=90000,'
        'encoding-name=H264,payload=96" ! rtp.recv_rtp_sink_0 '
        f'udpsrc port={port + 1} address=127.0.0.1 ! rtp.recv_rtcp_sink_0 '
        f'udpsrc port={port + 2} address=127.0.0.1 caps="application/x-rtp,media=application,clock-rate=90000,'
        'encoding-name=SMPTE336M,payload=97" ! rtp.recv_rtp_sink_1 '
        f'udpsrc port={port + 3} address=127.0.0.1 ! rtp.recv_rtcp_sink_1 '
        'rtp. ! application/x-rtp,media=video ! rtph264depay ! h264parse ! avdec_h264 ! combine.sink '
        'rtp. ! application/x-rtp,media=application ! rtpklvdepay ! combine.meta ' + GROUND)
    # Until the first RTCP report each stream's time starts where its first packet came, and x264enc's came late: here
    # reports come early and often.
    def report_often(rover):
        for session in (0, 1):
            internal = rover.pipeline.get_by_name('rtp').emit('get-internal-session', session)
            internal.set_property('rtcp-min-interval', 100 * Gst.MSECOND)
            internal.set_property('rtcp-fraction', 10000.0)
    return both(rover, ground, settling=25, prepare=report_often)


def udp_restart():
    """The rover is switched off and on again; the ground station is not."""
    port = free_udp_block()
    ground = Pipeline(f'udpsrc port={port} address=127.0.0.1 buffer-size=2000000 ! tsparse ! {DEMUX}')
    for name in ('sink', 'meta', 'src'):
        ground.count('combine', name)
    ground.play()
    time.sleep(0.3)
    sent = []
    end = time.monotonic() + TIMEOUT
    for _ in range(2):
        rover = Pipeline(rover_ts(True, f'udpsink host=127.0.0.1 port={port} sync=false'))
        rover.play()
        while time.monotonic() < end and len(rover.lines) < FRAMES:
            rover.check(0.05)
        ground.last_activity = time.monotonic()
        while time.monotonic() < end and time.monotonic() - ground.last_activity < 0.7:
            time.sleep(0.05)
        sent.append({line['frame']: comparable(line) for line in rover.lines})
        rover.stop()
    end_sources(ground)()
    if not ground.check(max(end - time.monotonic(), 1)):
        raise SystemExit('the ground does not come to its end')
    stats = ground.stats()
    print(f'ground: {ground.counts}, {stats}')
    good, run, last = True, 0, -1
    for line in ground.lines:
        run += line['frame'] <= last  # numbers begin anew
        last = line['frame']
        good &= run < 2 and sent[run].get(last) == comparable(line)
    report(good, 'every line is the rover\'s of that run and frame')
    # The demuxer and the decoder may keep the last frame of the first run until the second begins.
    good &= report(stats['matched'] >= 2 * FRAMES - 2 and stats['rejected'] == 0, f'{stats["matched"]} frames with units')
    ground.stop()
    return good


def mavlink_unheard(port):
    """Nobody listens on the port: the rover's pipeline goes on to its end as if somebody did."""
    rover = Pipeline(source(True) + 't. ! queue ! terrainextract name=e ! application/x-mavlink ! '
                     f'udpsink host=127.0.0.1 port={port} sync=false')
    rover.count('e', 'src')
    rover.play()
    ended = rover.check(TIMEOUT)
    messages = rover.counts['e.src']
    rover.stop()
    good = report(ended, 'the rover comes to its end, without an error')
    good &= report(len(rover.lines) == FRAMES, f'{len(rover.lines)} frames went by')
    # A busy machine loses frames of a live source: the time stamps say how long it was.
    seconds = (rover.lines[-1]['pts'] - rover.lines[0]['pts']) / 1e9
    return good & report(4 * seconds <= messages <= 15 * seconds + 2,
                         f'{messages} units in {seconds:.1f} s were sent into nothing')


def main(kind):
    Gst.init(None)
    if kind == 'file':
        return ts_file(lambda sink: rover_ts(False, sink))
    if kind == 'file-bframes':
        return ts_file(lambda sink: rover_ts(False, sink, 'x264enc bframes=2 key-int-max=25 ! h264parse'))
    if kind == 'file-after-encoder':
        return ts_file(rover_ts_after_encoder)
    if kind == 'rtp-klv':
        return rtp_klv()
    if kind == 'udp-restart':
        return udp_restart()
    port = free_udp_block()
    if kind == 'mavlink-unheard':
        return mavlink_unheard(port)
    if kind == 'udp-loss':
        return both(rover_ts(True, f'udpsink host=127.0.0.1 port={port} sync=false'),
                    f'udpsrc port={port} address=127.0.0.1 buffer-size=2000000 ! tsparse ! {DEMUX}', (0.05, 1))
    if kind == 'srt':
        uri = f'srt://127.0.0.1:{port}'
        secret = 'passphrase=a-long-enough-secret pbkeylen=16'
        return both(rover_ts(True, f'srtsink uri="{uri}?mode=caller" {secret} sync=false'),
                    f'srtsrc uri="{uri}?mode=listener" {secret} latency=200 ! {DEMUX}')
    if kind == 'rtp-ts':
        caps = 'application/x-rtp,media=video,clock-rate=90000,encoding-name=MP2T,payload=33'
        return both(rover_ts(True, f'rtpmp2tpay ! udpsink host=127.0.0.1 port={port} sync=false'),
                    f'udpsrc port={port} address=127.0.0.1 buffer-size=2000000 caps="{caps}" ! '
                    f'rtpjitterbuffer latency=100 ! rtpmp2tdepay ! {DEMUX}')
    raise SystemExit(__doc__)


def leave_with(body, seconds):
    """Ends the process with what `body` says. By os._exit, because a blocked pipeline would keep the interpreter from
    ending."""
    threading.Timer(seconds, lambda: (print('FAIL it hangs'), os._exit(3))).start()
    passed = False
    try:
        passed = body()
    except BaseException:
        traceback.print_exc()
    sys.stdout.flush()
    os._exit(0 if passed else 1)


if __name__ == '__main__':
    if os.environ.get('TERRAINSEG_SANITIZED'):
        print('skipped: a plugin built with sanitizers does not load into Python')
        sys.exit(77)
    leave_with(lambda: main(sys.argv[1]), TIMEOUT * 2)
