#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""usage: lying_links.py [CASE...]      CASE: FAULT-LINK, late, restart or jump, and -stamp or -parse behind; without words: all

-stamp: the rover writes precision times into its pictures (terrainstamp), and the ground reads them in front of its
decoder; -parse: the ground takes what h264parse reads, without that element. Then no fault may put a mask on a wrong frame.

A rover and a ground station with a proxy between them that drops, reorders, duplicates, corrupts, delays or splits
datagrams for a while. Links: ts (MPEG-TS over UDP), rtp (MPEG-TS over RTP), klv (video and units as two RTP streams).
Every picture has its run and number painted into it, plain and scrambled, so what a mask is put on is known without the metadata.
A line on the ground has to be, in every value, the rover's line of the frame that is in the picture; and within a
second of video after the last fault at least nine of ten frames have their mask again."""
import collections
import json
import os
import queue
import random
import socket
import sys
import threading
import time

import gi
import numpy

gi.require_version('Gst', '1.0')
gi.require_version('GstVideo', '1.0')
from gi.repository import Gst, GstVideo  # noqa: E402

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import transport  # noqa: E402
from ports import free_udp_block  # noqa: E402

WIDTH, HEIGHT, RATE = 320, 240, 25
META = 'GstTerrainSegMeta'
FIRST_FAULT, LAST_FAULT, FRAMES = 25, 60, 125  # numbers of frames
CELL = 16               # pixels of a painted bit's side
PLACES = (0, 96)        # rows where the code stands
RECOVERY = RATE         # frames: one second of video
READERS = {'': '', 'stamp': '! terrainstamp mode=read ', 'parse': ''}
CAPS = f'video/x-raw,format=I420,width={WIDTH},height={HEIGHT},framerate={RATE}/1'


def scrambled(code):
    """Another word of twenty bits. Where frames are lost a decoder adds the difference of a later picture to an earlier one,
    and what is painted then is the number of neither; no difference of two numbers is one of these words, too."""
    for factor in (0xb5297, 0x68e31):
        code = (code ^ code >> 9) * factor & 0xfffff
    return code ^ code >> 11


def paint(luma, run, number):
    """Twenty bits side by side, each above its inverse: four of the run, sixteen of the number, and below all scrambled."""
    for place, word in zip(PLACES, (run << 16 | number, scrambled(run << 16 | number))):
        for i in range(20):
            bit = word >> i & 1
            for row, value in ((0, bit), (1, 1 - bit)):
                luma[place + row * CELL:place + (row + 1) * CELL, i * CELL:(i + 1) * CELL] = 40 + 170 * value


def read_code(luma):
    """(run, number) when every bit is clear and both places agree; else None, a damaged picture."""
    codes = []
    for place in PLACES:
        cells = luma[place:place + 2 * CELL].astype(int).reshape(2, CELL, 20, CELL)[:, 4:12, :, 4:12].mean(axis=(1, 3))
        if (abs(cells[0] - cells[1]) < 100).any():
            return None
        codes.append(sum(int(cells[0, i] > cells[1, i]) << i for i in range(20)))
    return (codes[0] >> 16, codes[0] & 0xffff) if scrambled(codes[0]) == codes[1] else None


def scene():
    """Frames of a drive, once for all cases."""
    pipeline = Gst.parse_launch(f'terrainscenesrc num-buffers={FRAMES} scene=trail ! {CAPS} ! appsink name=out sync=false')
    pipeline.set_state(Gst.State.PLAYING)
    frames = []
    while sample := pipeline.get_by_name('out').emit('pull-sample'):
        buffer = sample.get_buffer()
        frames.append(numpy.frombuffer(buffer.extract_dup(0, buffer.get_size()), numpy.uint8))
    pipeline.set_state(Gst.State.NULL)
    return frames


class Rover(transport.Pipeline):
    """Sends frames in real time. `jump`: seconds that its clock leaps ahead at the frame LAST_FAULT."""

    def __init__(self, frames, outlet, run=0, jump=0):
        super().__init__(f'appsrc name=in format=time is-live=true caps="{CAPS}" ! terrainseg ! tee name=t '
                         f't. ! queue ! {transport.LINES} ! appsink name=lines sync=false max-buffers=1000 ' + outlet)
        self.frames, self.run, self.jump, self.pushed = frames, run, jump, 0

    def drive(self, count, watch=lambda: None):
        self.play()
        start = time.monotonic()
        for number in range(count):
            picture = self.frames[number].copy()
            paint(picture[:WIDTH * HEIGHT].reshape(HEIGHT, WIDTH), self.run, number)
            buffer = Gst.Buffer.new_wrapped(picture.tobytes())
            buffer.pts = number * Gst.SECOND // RATE + (self.jump * Gst.SECOND if number >= LAST_FAULT else 0)
            buffer.duration = Gst.SECOND // RATE
            time.sleep(max(0, start + number / RATE - time.monotonic()))
            self.pipeline.get_by_name('in').emit('push-buffer', buffer)
            self.pushed = number + 1
            watch()
        end = time.monotonic() + 10
        while len(self.lines) < count and time.monotonic() < end:
            self.check(0.05)

    def sent(self):
        return {line['frame']: transport.comparable(line) for line in self.lines}


class Ground(transport.Pipeline):
    """Knows of every frame that left terraincombine what is painted into it."""

    def __init__(self, inlet):
        super().__init__(inlet)
        self.codes = queue.SimpleQueue()  # of frames with a mask: lines come in their order. Time stamps would not do, in bursts frames share them
        self.shown = set()
        self.stale = set()                # numbers of matches whose picture had been shown before
        self.matches = []                 # (code in the picture, line)
        for name in ('sink', 'meta', 'src'):
            self.count('combine', name)
        self.pipeline.get_by_name('combine').get_static_pad('src').add_probe(Gst.PadProbeType.BUFFER, self.look)
        if rtp := self.pipeline.get_by_name('rtp'):
            rtp.connect('pad-added', self.take_stray)

    def take_stray(self, _rtp, pad):
        """A flipped bit in an RTP header makes a stream of its own, and what nobody takes ends the whole session."""
        if pad.get_direction() == Gst.PadDirection.SRC and not pad.is_linked():
            sink = Gst.ElementFactory.make('fakesink', None)
            sink.set_property('async', False)
            sink.set_property('sync', False)
            self.pipeline.add(sink)
            sink.sync_state_with_parent()
            pad.link(sink.get_static_pad('sink'))

    def look(self, pad, info):
        buffer = info.get_buffer()
        layout = GstVideo.buffer_get_video_meta(buffer)
        offset, stride = (layout.offset[0], layout.stride[0]) if layout else (0, WIDTH)
        luma = numpy.frombuffer(buffer.extract_dup(offset, stride * HEIGHT), numpy.uint8).reshape(HEIGHT, stride)
        code = read_code(luma[:, :WIDTH])
        if buffer.get_custom_meta(META):
            self.codes.put((buffer.pts, code, code in self.shown))
        self.shown.add(code)
        return Gst.PadProbeReturn.OK

    def take_line(self, sink):
        result = super().take_line(sink)
        line = self.lines[-1]
        pts, code, stale = self.codes.get(timeout=5)
        assert pts == line['pts'], 'lines and frames are out of step'
        if stale:
            self.stale.add(len(self.matches))
        self.matches.append((code, transport.comparable(line)))
        return result

    def finish(self):
        self.last_activity = time.monotonic()
        while time.monotonic() - self.last_activity < 0.7:
            time.sleep(0.05)
        transport.end_sources(self)()
        if not self.check(20):
            raise SystemExit('the ground does not come to its end')


class Proxy:
    """Forwards datagrams from `ports` to the same number of ports behind them; `fault` decides what becomes of one."""

    def __init__(self, ports, fault, seed=1):
        self.random = random.Random(seed)
        self.fault = fault
        self.active = False
        self.held = []  # (time to send, port, data)
        self.seen = self.faulty = 0
        self.on_fault = lambda: None
        self.out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.sockets = []
        for port in ports:
            self.sockets.append(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
            self.sockets[-1].setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 21)
            self.sockets[-1].bind(('127.0.0.1', port))
            self.sockets[-1].settimeout(0.005)
        self.shift = len(ports)
        self.lock = threading.Lock()
        self.stopped = False
        self.threads = [threading.Thread(target=self.forward, args=each) for each in enumerate(self.sockets)]
        for thread in self.threads:
            thread.start()

    def send(self, port, data):
        self.out.sendto(data, ('127.0.0.1', port + self.shift))

    def forward(self, _index, receiver):
        port = receiver.getsockname()[1]
        while not self.stopped:
            try:
                data = receiver.recv(65536)
            except socket.timeout:
                data = None
            with self.lock:
                now = time.monotonic()
                for item in [each for each in self.held if each[0] <= now]:
                    self.held.remove(item)
                    self.send(item[1], item[2])
                if data is None:
                    continue
                self.seen += 1
                if not self.active or not self.fault(self, port, data):
                    self.send(port, data)
                else:
                    self.faulty += 1
                    self.on_fault()

    def stop(self):
        self.stopped = True
        for thread in self.threads:
            thread.join()
        for each in (*self.sockets, self.out):
            each.close()


# Each returns True when it has dealt with the datagram.
def drop(proxy, _port, _data):
    return proxy.random.random() < 0.1


def reorder(proxy, port, data):
    if proxy.random.random() >= 0.2:
        return False
    proxy.held.append((time.monotonic() + proxy.random.uniform(0.005, 0.04), port, data))
    return True


def duplicate(proxy, port, data):
    if proxy.random.random() >= 0.2:
        return False
    proxy.send(port, data)
    proxy.held.append((time.monotonic() + proxy.random.choice((0, 0.03)), port, data))
    return True


def corrupt(proxy, port, data):
    if proxy.random.random() >= 0.2:
        return False
    damaged = bytearray(data)
    for _ in range(proxy.random.randint(1, 4)):
        damaged[proxy.random.randrange(len(damaged))] ^= 1 << proxy.random.randrange(8)
    proxy.send(port, bytes(damaged))
    return True


def delay(proxy, port, data):
    """Nothing for 0.4 s, then all at once."""
    proxy.held.append(((time.monotonic() // 0.4 + 1) * 0.4, port, data))
    return True


def split(proxy, port, data):
    if proxy.random.random() >= 0.5 or len(data) < 2:
        return False
    at = proxy.random.randrange(1, len(data))
    proxy.send(port, data[:at])
    proxy.send(port, data[at:])
    return True


FAULTS = {each.__name__: each for each in (drop, reorder, duplicate, corrupt, delay, split)}


def link(kind, stamps):
    """The rover's end, the ground's, and the ports that lie between."""
    base = free_udp_block(8)
    encoder = transport.ENCODER + (' ! terrainstamp' if stamps else '')
    reader = READERS[stamps]
    mux = (f't. ! queue ! {encoder} ! queue ! mux. t. ! queue ! terrainextract ! meta/x-klv,parsed=true ! queue ! mux. '
           'mpegtsmux name=mux alignment=7 latency=100000000 ! ')
    if kind == 'ts':
        return (mux + f'udpsink host=127.0.0.1 port={base} sync=false',
                f'udpsrc port={base + 1} address=127.0.0.1 buffer-size=2000000 ! tsparse ! {transport.demux(reader)}', [base])
    if kind == 'rtp':
        caps = 'application/x-rtp,media=video,clock-rate=90000,encoding-name=MP2T,payload=33'
        return (mux + f'rtpmp2tpay ! udpsink host=127.0.0.1 port={base} sync=false',
                f'udpsrc port={base + 1} address=127.0.0.1 buffer-size=2000000 caps="{caps}" ! '
                f'rtpjitterbuffer latency=100 ! rtpmp2tdepay ! {transport.demux(reader)}', [base])
    udp = 'sync=false async=false'
    # After a loss rtpklvdepay 1.22 refuses every unit of more than one packet, until one of one packet comes.
    one_packet = 'mtu=65000' if stamps else ''
    rover = ('rtpbin name=rtp '
             f't. ! queue ! {encoder} ! rtph264pay pt=96 ! rtp.send_rtp_sink_0 '
             f't. ! queue ! terrainextract ! meta/x-klv,parsed=true ! rtpklvpay pt=97 {one_packet} ! rtp.send_rtp_sink_1 ')
    ground = 'rtpbin name=rtp latency=100 '
    payloads = ('video,clock-rate=90000,encoding-name=H264,payload=96', 'application,clock-rate=90000,encoding-name=SMPTE336M,payload=97')
    for i, payload in enumerate(payloads):
        rover += (f'rtp.send_rtp_src_{i} ! udpsink host=127.0.0.1 port={base + 2 * i} {udp} '
                  f'rtp.send_rtcp_src_{i} ! udpsink host=127.0.0.1 port={base + 2 * i + 1} {udp} ')
        ground += (f'udpsrc port={base + 4 + 2 * i} address=127.0.0.1 caps="application/x-rtp,media={payload}" ! rtp.recv_rtp_sink_{i} '
                   f'udpsrc port={base + 5 + 2 * i} address=127.0.0.1 ! rtp.recv_rtcp_sink_{i} ')
    return rover, ground + (
        f'rtp. ! application/x-rtp,media=video ! rtph264depay ! h264parse {reader}! avdec_h264 ! combine.sink '
        'rtp. ! application/x-rtp,media=application ! rtpklvdepay ! combine.meta ' + transport.GROUND), list(range(base, base + 4))


def stamps_of(name):
    return next((way for way in READERS if way and name.endswith('-' + way)), '')


def recovered_at(numbers, begin):
    """The first number from `begin` on, of which and the nine after it nine have their mask; None = none."""
    have = set(numbers)
    for first in range(begin, FRAMES - 10):
        if first in have and sum(n in have for n in range(first, first + 10)) >= 9:
            return first
    return None


def judge(name, rovers, ground, begin):
    """`begin`: number of the last run's frame from which on the link was sound."""
    stats = ground.stats()
    stamped = stamps_of(name)
    sent = {rover.run: rover.sent() for rover in rovers}
    readable = [(code, line) for code, line in ground.matches if code is not None]
    if name.startswith('corrupt'):
        # A flipped bit in a slice's header makes a picture the copy of an older one: a number shown before names no frame.
        readable = [each for i, each in enumerate(ground.matches) if each[0] is not None and i not in ground.stale]
    wrong = [(code, line['frame']) for code, line in readable if sent.get(code[0], {}).get(code[1]) != line]
    # A picture too damaged to be read still must not bring a unit that nobody sent.
    invented = [line['frame'] for code, line in ground.matches
                if (code, line) not in readable and all(lines.get(line['frame']) != line for lines in sent.values())]
    last = rovers[-1]
    numbers = [code[1] for code, _ in readable if code[0] == last.run]
    at = recovered_at(numbers, begin)
    after = '-' if at is None else f'{(at - begin) / RATE:.2f}'
    print(f'{name:14} {len(ground.matches):4} masks on {ground.counts["combine.src"]:4} frames, {ground.counts["combine.meta"]} units '
          f'({len(readable)} pictures with a mask could be read), '
          f'{len(wrong)} on a wrong frame, {len(invented)} invented; sound again after {after} s; {stats}')
    good = transport.report(not wrong and not invented, f'{name}: never a mask on a wrong frame {wrong[:5]}{invented[:5]}')
    good &= transport.report(stats['matched-precisely'] == (stats['matched'] if stamped else 0),
                             f'{name}: {stats["matched-precisely"]} of {stats["matched"]} matched by precision time')
    good &= transport.report(len(readable) >= 20, f'{name}: enough pictures could be read')
    good &= transport.report(at is not None and at - begin <= RECOVERY, f'{name}: recovery within a second of video')
    good &= transport.report(len({json.dumps(line["mask"]) for line in sent[last.run].values()}) > FRAMES // 4,
                             f'{name}: the masks differ, so the check can fail')
    return good


def fault_case(name, frames):
    fault, kind = name.split('-')[:2]
    rover_end, ground_end, ports = link(kind, stamps_of(name))
    ground, rover, proxy = Ground(ground_end), Rover(frames, rover_end), Proxy(ports, FAULTS[fault])
    if kind == 'klv':  # until the first RTCP report two RTP streams are not in step
        for session in (0, 1):
            internal = rover.pipeline.get_by_name('rtp').emit('get-internal-session', session)
            internal.set_property('rtcp-min-interval', 100 * Gst.MSECOND)
            internal.set_property('rtcp-fraction', 10000.0)
    last_fault = LAST_FAULT

    def note():
        nonlocal last_fault
        last_fault = max(last_fault, rover.pushed)

    def watch():
        proxy.active = FIRST_FAULT <= rover.pushed < LAST_FAULT
    proxy.on_fault = note
    try:
        ground.play()
        time.sleep(0.3)
        rover.drive(FRAMES, watch)
        ground.finish()
        good = transport.report(proxy.faulty >= 3, f'{name}: {proxy.faulty} of {proxy.seen} datagrams met the fault')
        return judge(name, [rover], ground, last_fault) and good
    finally:
        proxy.stop()
        rover.stop()
        ground.stop()


def late_case(name, frames):
    rover_end, ground_end, ports = link('ts', stamps_of(name))
    ground, rover, proxy = Ground(ground_end), Rover(frames, rover_end), Proxy(ports, drop)
    begin = []

    def watch():
        if rover.pushed == FIRST_FAULT:
            ground.play()
            begin.append(rover.pushed)
    try:
        rover.drive(FRAMES, watch)
        ground.finish()
        return judge(name, [rover], ground, begin[0])
    finally:
        proxy.stop()
        rover.stop()
        ground.stop()


def restart_case(name, frames):
    """The sender is switched off in the middle and begins again from frame 0 with other times."""
    rover_end, ground_end, ports = link('ts', stamps_of(name))
    ground, proxy = Ground(ground_end), Proxy(ports, drop)
    rovers = []
    try:
        ground.play()
        time.sleep(0.3)
        for run, count in enumerate((LAST_FAULT, FRAMES)):
            rovers.append(Rover(frames, rover_end, run))
            rovers[-1].drive(count)
            rovers[-1].stop()
        ground.finish()
        return judge(name, rovers, ground, 0)
    finally:
        proxy.stop()
        for rover in rovers:
            rover.stop()
        ground.stop()


def jump_case(name, frames):
    """The sender's clock leaps an hour ahead."""
    rover_end, ground_end, ports = link('ts', stamps_of(name))
    ground, rover, proxy = Ground(ground_end), Rover(frames, rover_end, jump=3600), Proxy(ports, drop)
    try:
        ground.play()
        time.sleep(0.3)
        rover.drive(FRAMES)
        ground.finish()
        return judge(name, [rover], ground, LAST_FAULT)
    finally:
        proxy.stop()
        rover.stop()
        ground.stop()


CASES = [f'{fault}-{kind}' for kind in ('ts', 'rtp', 'klv') for fault in FAULTS if kind == 'ts' or fault != 'split'] + [
    'late', 'restart', 'jump']
CASES += [f'{case}-{way}' for way in READERS if way for case in CASES]


def main(names):
    Gst.init(None)
    Gst.ElementFactory.make('terrainseg', None)
    unknown = set(names) - set(CASES)
    if unknown:
        raise SystemExit(f'{__doc__}\nunknown: {unknown}; known: {" ".join(CASES)}')
    frames = scene()
    own = {'late': late_case, 'restart': restart_case, 'jump': jump_case}
    results = collections.Counter()
    for name in names or CASES:
        results[own.get(name.split('-')[0], fault_case)(name, frames)] += 1
        sys.stdout.flush()
    print(f'{results[True]} passed, {results[False]} failed')
    return not results[False]


if __name__ == '__main__':
    if os.environ.get('TERRAINSEG_SANITIZED'):
        print('skipped: a plugin built with sanitizers does not load into Python')
        sys.exit(77)
    transport.leave_with(lambda: main(sys.argv[1:]), 60 * max(1, len(sys.argv) - 1 or len(CASES)))
