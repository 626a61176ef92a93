#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Masks as numpy arrays, with Debian's own bindings: python3-gi, gir1.2-gst-plugins-base-1.0, python3-numpy.

usage: mask_to_numpy.py [VIDEO]        without a video: a rendered scene of 60 frames

Copy frames() into your program. It reads the metadata of every frame, and on request the picture.
"""
import argparse
import os
import sys

import gi

gi.require_version('Gst', '1.0')
gi.require_version('GstVideo', '1.0')
from gi.repository import Gst, GstVideo  # noqa: E402  (the versions must be chosen before)
import numpy as np  # noqa: E402

import find_plugin  # noqa: E402  (where the plugin is installed Gst.init(None) does)

find_plugin.init()

FLAGS = {1: 'learned', 2: 'frozen', 4: 'starved', 8: 'unknown', 16: 'horizon held', 32: 'blocked',
         64: 'window still'}


def bytes_of(buffer):
    return buffer.extract_dup(0, buffer.get_size())


def array_of_mask(mask):
    """The GRAY8 buffer of a mask or confidence map as an array of (rows, columns); rows may be padded in memory."""
    layout = GstVideo.buffer_get_video_meta(mask)
    pixels = np.frombuffer(bytes_of(mask), np.uint8, offset=layout.offset[0])
    rows = np.lib.stride_tricks.as_strided(pixels, (layout.height, layout.width), (layout.stride[0], 1))
    return rows.copy()


def estimate_of(buffer):
    """The terrainseg metadata of `buffer` as a dictionary, or None without metadata."""
    meta = buffer.get_custom_meta('GstTerrainSegMeta')
    if meta is None:
        return None
    fields = meta.get_structure()
    flags = fields.get_value('flags')
    horizon = fields.get_value('horizon-row')
    sureness = fields.get_value('confidence-map')
    return {
        'frame': fields.get_value('frame'),
        'pts': buffer.pts,
        'width': fields.get_value('frame-width'),
        'height': fields.get_value('frame-height'),
        'horizon': None if horizon < 0 else horizon,
        'confidence': fields.get_value('confidence') / 255,
        'traversable': fields.get_value('traversable-permille') / 1000,
        # 0 not traversable, 128 doubtful or unknown, 255 traversable
        'mask': array_of_mask(fields.get_value('mask')),
        # how sure the mask is, in coarse cells spread over it: 0 = a toss, 1 = certain; None with preset=paper
        'confidence-map': None if sureness is None else array_of_mask(sureness) / 255,
        # per mask column the highest row of the free space ahead; the frame's height = none
        'boundary': np.frombuffer(bytes_of(fields.get_value('boundary')), '<u2'),
        'flags': {name for bit, name in FLAGS.items() if flags & bit},
    }


def samples(pipeline):
    """What the appsink `out` of a playing pipeline gives. An error of any element ends it: an appsink alone would wait
    for ever."""
    out, bus = pipeline.get_by_name('out'), pipeline.get_bus()
    while True:
        sample = out.emit('try-pull-sample', Gst.SECOND // 10)
        if sample:
            yield sample
            continue
        message = bus.pop_filtered(Gst.MessageType.ERROR)
        if message:
            error, details = message.parse_error()
            raise RuntimeError(' '.join([error.message, *(details or '').splitlines()[-1:]]))  # the last line names the file
        if out.get_property('eos'):
            return


def frames(source, settings='', picture=False):
    """Yields the estimate of every frame of `source`, a piece of a pipeline that gives raw video.

    With picture=True each has 'picture', an array of (height, width, 3) in RGB."""
    caps = 'videoconvert ! video/x-raw,format=RGB !' if picture else ''
    pipeline = Gst.parse_launch(f'{source} ! terrainseg {settings} ! {caps} '
                                'appsink name=out sync=false max-buffers=4')
    pipeline.set_state(Gst.State.PLAYING)
    try:
        for sample in samples(pipeline):
            estimate = estimate_of(sample.get_buffer())
            if estimate is None:
                continue
            if picture:
                buffer, size = sample.get_buffer(), (estimate['height'], estimate['width'])
                stride = buffer.get_size() // size[0]
                rows = np.frombuffer(bytes_of(buffer), np.uint8).reshape(size[0], stride)
                estimate['picture'] = rows[:, :size[1] * 3].reshape(*size, 3)
            yield estimate
    finally:
        pipeline.set_state(Gst.State.NULL)


def source_of(video):
    if video is None:
        return 'terrainscenesrc num-buffers=60 ! video/x-raw,width=320,height=180'
    return find_plugin.upright(video)


def main():
    parser = argparse.ArgumentParser(description='Masks as numpy arrays: prints one line per frame.')
    parser.add_argument('video', metavar='VIDEO', nargs='?', help='without one: a rendered scene of 60 frames')
    for each in frames(source_of(parser.parse_args().video)):
        share = np.mean(each['mask'] == 255)
        print(f"frame {each['frame']}: {each['mask'].shape[1]}x{each['mask'].shape[0]} mask, "
              f"{100 * share:.1f} % traversable, horizon {each['horizon']}", flush=True)


if __name__ == '__main__':
    try:
        main()
    except RuntimeError as error:
        sys.exit(f'mask_to_numpy: {error}')
    except BrokenPipeError:  # `| head` has seen enough; nothing may be flushed at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
