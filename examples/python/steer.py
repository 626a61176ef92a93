#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Steers towards the widest free space ahead: one command per frame, from the boundary alone. No ROS, no numpy.

usage: steer.py [--depth 0.25] [VIDEO]        without a video: a rendered scene of 90 frames
       steer.py --link 'udpsrc ... ! tsdemux name=d ... terraincombine name=link'     over a link (docs/security.md)

Prints   frame 12 steer +0.130 speed 0.72   (steer: -1 full left .. 1 full right; speed: 0 stop .. 1),
         frame 13 stop: blocked             if the way is blocked or nothing is known,
         stop: no picture                   if no frame came for half a second, for example after the camera died,
or       frame - stop: stale ...            for half a second after the link lost or rejected metadata.

A mask does not prove that the ground carries the vehicle. The near-range sensor stays responsible for stopping.
"""
import argparse
import array
import os
import sys

import gi

gi.require_version('Gst', '1.0')
from gi.repository import Gst  # noqa: E402

import find_plugin  # noqa: E402  (where the plugin is installed Gst.init(None) does)

BLOCKED = 32
SILENCE = Gst.SECOND // 2


def widest_run(free):
    """Begin and end (exclusive) of the longest run of true values, the one nearest to the middle of equals."""
    runs, begin = [], None
    for column, is_free in enumerate([*free, False]):
        if is_free and begin is None:
            begin = column
        elif not is_free and begin is not None:
            runs.append((begin, column))
            begin = None
    middle = len(free) / 2
    return max(runs, key=lambda run: (run[1] - run[0], -abs(sum(run) / 2 - middle)), default=None)


def steer(boundary, height, depth):
    """(steer, speed) towards the widest space that is free for `depth` of the frame's height; None = stop.

    boundary: per column the highest free row, `height` where there is none."""
    needed = height * (1 - depth)
    run = widest_run([row <= needed for row in boundary])
    if run is None:
        return None
    begin, end = run
    middle = (begin + end) / 2
    width = (end - begin) / len(boundary)
    deepest = (height - min(boundary[begin:end])) / height
    return 2 * middle / len(boundary) - 1, min(1.0, 0.5 * width + deepest)


def boundary_of(fields):
    """uint16 little-endian, one a column."""
    buffer = fields.get_value('boundary')
    rows = array.array('H', buffer.extract_dup(0, buffer.get_size()))
    if sys.byteorder == 'big':
        rows.byteswap()
    return rows


class Driver:
    """Smooths the commands: a boundary jumps more than a wheel may."""

    def __init__(self, depth):
        self.depth = depth
        self.angle = 0.0

    def command(self, fields):
        if fields.get_value('flags') & BLOCKED:
            return 'stop: blocked'
        aim = steer(boundary_of(fields), fields.get_value('frame-height'), self.depth)
        if aim is None:
            return 'stop: no free space'
        self.angle += 0.4 * (aim[0] - self.angle)
        return f'steer {self.angle:+.3f} speed {aim[1]:.2f}'


class Link:
    """Whether metadata from a link may be used for steering: not for half a second of frames after metadata was lost or
    rejected. A missing unit is harmless, but a forged unit shows in the same way."""

    def __init__(self, combine):
        self.combine = combine
        self.seen = (0, 0)
        self.fresh_from = 0

    def stale(self, time):
        """What is wrong at this frame's time stamp, or None."""
        stats = self.combine.get_property('stats')
        counts = tuple(stats.get_uint64(name).value for name in ('lost', 'rejected'))
        if counts != self.seen:
            self.seen, self.fresh_from = counts, time + SILENCE
        # A time stamp far before that is another stream's, not a fresh one.
        return f'stale, {counts[0]} lost, {counts[1]} rejected' if time < self.fresh_from else None


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--depth', type=float, default=0.25, help='share of the frame height that must be free (0.25)')
    parser.add_argument('--settings', default='', help='properties of terrainseg, as in gst-launch-1.0')
    parser.add_argument('--link', help='instead of terrainseg: a pipeline that ends in a terraincombine named link')
    parser.add_argument('video', nargs='?')
    options = parser.parse_args()
    if not 0 < options.depth <= 1:
        parser.error(f'--depth {options.depth:g}: use more than 0 and at most 1, of the frame height')

    find_plugin.init()
    source = 'terrainscenesrc num-buffers=90 ! video/x-raw,width=320,height=180'
    if options.video:
        source = find_plugin.upright(options.video)
    # On a rover the newest frame counts: there put  queue leaky=downstream max-size-buffers=1  before terrainseg.
    seen = options.link or f'{source} ! terrainseg mask-level=2 {options.settings}'
    pipeline = Gst.parse_launch(f'{seen} ! appsink name=out sync=false max-buffers=1')
    link = Link(pipeline.get_by_name('link')) if options.link else None
    out, bus = pipeline.get_by_name('out'), pipeline.get_bus()
    driver = Driver(options.depth)
    pipeline.set_state(Gst.State.PLAYING)
    while True:
        sample = out.emit('try-pull-sample', SILENCE)
        if sample:
            meta = sample.get_buffer().get_custom_meta('GstTerrainSegMeta')
            fields = meta.get_structure() if meta else None
            problem = link.stale(sample.get_buffer().pts) if link else None
            if problem or (link and not fields):
                print(f"frame {fields.get_value('frame') if fields else '-'} stop: {problem or 'stale'}", flush=True)
            elif fields:
                print(f"frame {fields.get_value('frame')} {driver.command(fields)}", flush=True)
            continue
        message = bus.pop_filtered(Gst.MessageType.ERROR)
        if message or out.get_property('eos'):
            break
        print('stop: no picture', flush=True)
    pipeline.set_state(Gst.State.NULL)
    if message:
        error, details = message.parse_error()
        sys.exit(' '.join(['steer:', error.message, *(details or '').splitlines()[-1:]]))  # the last line names the file


if __name__ == '__main__':
    try:
        main()
    except BrokenPipeError:  # `| head` has seen enough; nothing may be flushed at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
