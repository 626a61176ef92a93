#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Combines terrainseg with a detector of your own: what the detector finds is never traversable and is not learned.

usage: veto.py [--detector people|X,Y,W,H] [VIDEO]      without a video: a rendered scene of 60 frames

The detector here is OpenCV's detector of standing people (python3-opencv). Replace people() with yours. It gets a picture as an
array of (height, width, 3) in RGB and returns rectangles (x, y, width, height) in pixels. --detector X,Y,W,H takes this rectangle in
every frame, to try the effect without a detector.

The rectangles travel as the stock GstVideoRegionOfInterestMeta of type "person", and veto-roi-types=person makes them vetoes. If an
element of your pipeline attaches such regions already, that property is all you need. attach_mask() is for detectors of shapes.
"""
import argparse
import ctypes
import os
import pathlib
import sys

import gi

gi.require_version('Gst', '1.0')
gi.require_version('GstVideo', '1.0')
from gi.repository import GLib, GObject, Gst, GstVideo  # noqa: E402
import numpy as np  # noqa: E402

from mask_to_numpy import samples, source_of  # noqa: E402  (loads the plugin)

KEPT = Gst.BufferCopyFlags.FLAGS | Gst.BufferCopyFlags.TIMESTAMPS | Gst.BufferCopyFlags.META | Gst.BufferCopyFlags.MEMORY


def people():
    import cv2
    hog = cv2.HOGDescriptor()
    hog.setSVMDetector(cv2.HOGDescriptor_getDefaultPeopleDetector())

    def detect(picture):
        if picture.shape[0] < 128 or picture.shape[1] < 64:
            return []  # smaller than the smallest person that it knows
        return [tuple(int(side) for side in box) for box in hog.detectMultiScale(picture, winStride=(8, 8))[0]]
    return detect


def picture_of(buffer, caps):
    info = GstVideo.VideoInfo.new_from_caps(caps)
    pixels = np.frombuffer(buffer.extract_dup(0, buffer.get_size()), np.uint8)
    rows = pixels[:info.stride[0] * info.height].reshape(info.height, info.stride[0])
    return np.ascontiguousarray(rows[:, :info.width * 3].reshape(info.height, info.width, 3))


def attach_box(buffer, kind, box):
    """A region of interest, cut to the frame on the left and on top, where its fields cannot be negative."""
    x, y, width, height = box
    right, bottom, x, y = x + width, y + height, max(x, 0), max(y, 0)
    if right > x and bottom > y:
        GstVideo.buffer_add_video_region_of_interest_meta(buffer, kind, x, y, right - x, bottom - y)


def attach_mask(buffer, mask):
    """A GstTerrainVetoMeta. `mask`: array of (rows, columns) of any size, stretched over the frame; 128 and more is a veto.

    The bindings hand out a copy of a meta's structure, so the field is set through C."""
    rows, columns = mask.shape
    pixels = Gst.Buffer.new_wrapped(np.ascontiguousarray(mask, np.uint8).tobytes())
    GstVideo.buffer_add_video_meta_full(pixels, GstVideo.VideoFrameFlags.NONE, GstVideo.VideoFormat.GRAY8, columns, rows, 1,
                                        [0, 0, 0, 0], [columns, 0, 0, 0])
    gst = ctypes.CDLL('libgstreamer-1.0.so.0')
    gst.gst_custom_meta_get_structure.restype = ctypes.c_void_p
    gst.gst_custom_meta_get_structure.argtypes = [ctypes.c_void_p]
    gst.gst_structure_set_value.argtypes = [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p]
    value = GObject.Value(Gst.Buffer, pixels)
    meta = buffer.add_custom_meta('GstTerrainVetoMeta')
    gst.gst_structure_set_value(gst.gst_custom_meta_get_structure(hash(meta)), b'mask', hash(value))


def frames(source, detect, settings='veto-roi-types=person'):
    """Yields the number of boxes, and the sample with the metadata, of every frame of `source`."""
    pipeline = Gst.parse_launch(f'{source} ! videoconvert ! video/x-raw,format=RGB ! appsink name=out sync=false max-buffers=1 '
                                f'appsrc name=in format=time block=true max-buffers=1 ! terrainseg {settings} '
                                '! appsink name=labelled async=false sync=false max-buffers=1')
    entry, labelled = pipeline.get_by_name('in'), pipeline.get_by_name('labelled')
    pipeline.set_state(Gst.State.PLAYING)
    try:
        for sample in samples(pipeline):
            # Shares the pixels; its metadata can be written to.
            buffer = sample.get_buffer().copy_region(KEPT, 0, GLib.MAXSIZE)
            boxes = detect(picture_of(buffer, sample.get_caps()))
            for box in boxes:
                attach_box(buffer, 'person', box)
            entry.set_property('caps', sample.get_caps())
            entry.emit('push-buffer', buffer)
            yield len(boxes), labelled.emit('pull-sample')
    finally:
        pipeline.set_state(Gst.State.NULL)


def detector(text):
    if text == 'people':
        return people()
    box = tuple(int(number) for number in text.split(','))
    if len(box) != 4 or box[2] < 1 or box[3] < 1:
        raise ValueError
    return lambda picture: [box]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--detector', metavar='people|X,Y,W,H', default='people')
    parser.add_argument('--settings', default='', help='properties of terrainseg, as in gst-launch-1.0')
    parser.add_argument('video', metavar='VIDEO', nargs='?', help='without one: a rendered scene of 60 frames')
    options = parser.parse_args()
    try:
        detect = detector(options.detector)
    except ImportError:
        sys.exit('veto: OpenCV for Python is missing: apt install python3-opencv, or --detector X,Y,W,H')
    except ValueError:
        parser.error(f'--detector {options.detector}: use people, or X,Y,W,H in pixels')
    for boxes, sample in frames(source_of(options.video), detect, f'veto-roi-types=person {options.settings}'):
        fields = sample.get_buffer().get_custom_meta('GstTerrainSegMeta').get_structure()
        print(f"frame {fields.get_value('frame')}: {boxes} {'person' if boxes == 1 else 'people'}, "
              f"{fields.get_value('traversable-permille') / 10:.1f} % traversable", flush=True)


if __name__ == '__main__':
    try:
        main()
    except (RuntimeError, GLib.GError) as error:
        sys.exit(f'veto: {error}')
    except BrokenPipeError:  # `| head` has seen enough; nothing may be flushed at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
