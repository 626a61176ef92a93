#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""How far the way is free, in metres: for every frame the range straight ahead and the nearest obstacle. No numpy.

usage: metres.py [--camera-info FILE --mount FILE|height=..,pitch=..] [--start-time TIME] [VIDEO]
       without a video: a rendered scene of 60 frames with the calibration of its camera

Prints   frame 12 20:00:00.400 ahead 3.412 m (3.105 .. 3.784) nearest 2.107 m at +12.3 degrees
         (degrees: positive = to the left; in brackets one standard deviation to either side),
         frame 13 ... ahead free to 12.5 m       if the way is free up to range-max,
or       frame 14 ... unknown                    if there are no metres: no calibration, no pose, nothing learned.
"""
import argparse
import array
import math
import os
import sys
import tempfile

import gi

gi.require_version('Gst', '1.0')
from gi.repository import Gst  # noqa: E402

import find_plugin  # noqa: E402  (where the plugin is installed Gst.init(None) does)

AHEAD = math.radians(5)  # columns that are straight ahead: to either side
SCENE = """image_width: 640
image_height: 360
camera_matrix: {rows: 3, cols: 3, data: [524.8, 0, 319.5, 0, 524.8, 179.5, 0, 0, 1]}
"""


def floats_of(fields, name):
    """float32 little-endian, one a column of the boundary."""
    buffer = fields.get_value(name)
    values = array.array('f', buffer.extract_dup(0, buffer.get_size()))
    if sys.byteorder == 'big':
        values.byteswap()
    return values


def metres_of(buffer):
    """The boundary in metres as a dictionary of lists, None when the frame has none. Ranges are `inf` where the way is
    free as far as `range_max`, and `nan` where nothing is known."""
    meta = buffer.get_custom_meta('GstTerrainMetricMeta')
    if meta is None:
        return None
    fields = meta.get_structure()
    metres = {name: floats_of(fields, name) for name in ('ranges', 'bearings', 'low', 'high')}
    return {**metres, **{name.replace('-', '_'): fields.get_value(name) for name in ('height', 'pitch', 'roll', 'range-max')}}


def utc_of(buffer):
    """Nanoseconds since 1970, None when the time of day is not known."""
    meta = buffer.get_reference_timestamp_meta(Gst.Caps.new_empty_simple('timestamp/x-unix'))
    return meta.timestamp if meta else None


def nearest(metres, within=math.pi):
    """(range, low, high, bearing) of the nearest column at most `within` radians from straight ahead, with an infinite range
    where all is free. None when not all of them are known: what is not known is no free way."""
    columns = [column for column in zip(metres['ranges'], metres['low'], metres['high'], metres['bearings'])
               if not abs(column[3]) > within]  # a bearing that is not known is in the way too
    if not columns or any(math.isnan(column[0]) for column in columns):
        return None
    return min(columns)


def text_of(metres):
    ahead = nearest(metres, AHEAD) if metres else None
    if ahead is None:
        return 'unknown'
    limit = metres['range_max']
    if math.isinf(ahead[0]):
        text = f'ahead free to {limit:.1f} m'
    else:
        text = f'ahead {ahead[0]:.3f} m ({ahead[1]:.3f} .. {min(ahead[2], limit):.3f})'
    known = [column for column in zip(metres['ranges'], metres['bearings']) if column[0] < math.inf]
    if known:
        text += f' nearest {min(known)[0]:.3f} m at {math.degrees(min(known)[1]):+.1f} degrees'
    return text


def clock_of(utc):
    if utc is None:
        return ''
    seconds, rest = divmod(utc // 1_000_000, 1000)
    return f'{seconds // 3600 % 24:02d}:{seconds // 60 % 60:02d}:{seconds % 60:02d}.{rest:03d} '


def samples(pipeline):
    """What the appsink `out` of a playing pipeline gives; an error of any element ends it."""
    out, bus = pipeline.get_by_name('out'), pipeline.get_bus()
    while not out.get_property('eos'):
        sample = out.emit('try-pull-sample', Gst.SECOND // 10)
        if sample:
            yield sample
        message = bus.pop_filtered(Gst.MessageType.ERROR)
        if message:
            error, details = message.parse_error()
            raise RuntimeError(' '.join([error.message, *(details or '').splitlines()[-1:]]))  # the last line names the file


def run(source, camera_info, mount, start_time):
    pipeline = Gst.parse_launch(f'{source} ! terrainseg name=terrain ! appsink name=out sync=false max-buffers=4')
    terrain = pipeline.get_by_name('terrain')
    for name, value in (('camera-info', camera_info), ('mount', mount), ('start-time', start_time)):
        if value:
            terrain.set_property(name, value)
    pipeline.set_state(Gst.State.PLAYING)
    try:
        for sample in samples(pipeline):
            buffer = sample.get_buffer()
            number = buffer.get_custom_meta('GstTerrainSegMeta').get_structure().get_value('frame')
            print(f'frame {number} {clock_of(utc_of(buffer))}{text_of(metres_of(buffer))}', flush=True)
    finally:
        pipeline.set_state(Gst.State.NULL)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--camera-info')
    parser.add_argument('--mount')
    parser.add_argument('--start-time', help='time of day of the first frame, ISO 8601')
    parser.add_argument('video', nargs='?')
    options = parser.parse_args()
    find_plugin.init()
    if options.video:
        run(find_plugin.upright(options.video), options.camera_info, options.mount, options.start_time)
        return
    with tempfile.NamedTemporaryFile('w', suffix='.yaml') as camera:
        camera.write(SCENE)
        camera.flush()
        run('terrainscenesrc num-buffers=60 ! video/x-raw,width=640,height=360', options.camera_info or camera.name,
            options.mount or 'height=1.35,pitch=0.045', options.start_time)


if __name__ == '__main__':
    try:
        main()
    except RuntimeError as error:
        sys.exit(f'metres: {error}')
    except BrokenPipeError:  # `| head` has seen enough; nothing may be flushed at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
