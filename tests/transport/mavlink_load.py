#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""usage: mavlink_load.py

A live camera of 30 frames a second, terrainseg, MAVLink, while every processor is busy with something else: an autopilot
that hears nothing for half a second stops to avoid, so obstacles must come at least four times in every second."""
import multiprocessing
import os
import sys
import tempfile
import time

import gi

gi.require_version('Gst', '1.0')
from gi.repository import Gst  # noqa: E402

SECONDS = 8
LONGEST = 0.5  # seconds of silence after which ArduPilot ignores the sensor
RATE = 4       # messages in every second
OBSTACLE_DISTANCE = 330
CAMERA = """image_width: 640
image_height: 480
camera_matrix: {rows: 3, cols: 3, data: [554, 0, 319.5, 0, 554, 239.5, 0, 0, 1]}
"""


def burn():
    while True:
        pass


def ids_of(data):
    """Message ids of the MAVLink 2 frames in a unit."""
    while data:
        assert data[0] == 0xfd, data[:12].hex()
        yield int.from_bytes(data[7:10], 'little')
        data = data[12 + data[1]:]


def busy_share(before):
    """Share of all processors' time that was not idle since `before`."""
    now = [int(word) for word in open('/proc/stat').readline().split()[1:9]]
    if not before:
        return now
    spent = [a - b for a, b in zip(now, before)]
    return 1 - (spent[3] + spent[4]) / sum(spent)


def main():
    Gst.init(None)
    times = []
    with tempfile.NamedTemporaryFile('w', suffix='.yaml') as camera:
        camera.write(CAMERA)
        camera.flush()
        pipeline = Gst.parse_launch(
            'videotestsrc is-live=true pattern=ball ! video/x-raw,format=I420,width=640,height=480,framerate=30/1 ! '
            'queue leaky=downstream max-size-buffers=1 ! '
            f'terrainseg camera-info={camera.name} mount=height=0.5,pitch=10deg ! terrainextract ! application/x-mavlink ! '
            'appsink name=out sync=false')
        out = pipeline.get_by_name('out')
        burners = [multiprocessing.Process(target=burn, daemon=True) for _ in range(os.cpu_count())]
        for burner in burners:
            burner.start()
        pipeline.set_state(Gst.State.PLAYING)
        try:
            first = out.emit('try-pull-sample', 20 * Gst.SECOND)
            assert first, 'nothing came'
            idle, end = busy_share(None), time.monotonic() + SECONDS
            while time.monotonic() < end:
                sample = out.emit('try-pull-sample', Gst.SECOND)
                if sample and OBSTACLE_DISTANCE in ids_of(sample.get_buffer().extract_dup(0, sample.get_buffer().get_size())):
                    times.append(time.monotonic())
            busy = busy_share(idle)
        finally:
            for burner in burners:
                burner.kill()
            pipeline.set_state(Gst.State.NULL)
    gaps = sorted((b - a for a, b in zip(times, times[1:])), reverse=True)
    last = times[0] + SECONDS - 1.5
    rates = [sum(begin <= t < begin + 1 for t in times) for begin in times if begin <= last]
    print(f'{100 * busy:.0f} % busy, {len(times) / SECONDS:.1f} messages a second, at least {min(rates)} in each, longest '
          f'silence {gaps[0]:.3f} s')
    if busy < 0.95:
        print('the processors were not busy: nothing was tested')
        return 77
    return 0 if min(rates) >= RATE and gaps[0] < LONGEST else 1


if __name__ == '__main__':
    sys.exit(main())
