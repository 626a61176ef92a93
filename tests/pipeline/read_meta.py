#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""The metadata as a Python program reads it, with the bindings that Debian ships.

Runs the frames through a converter and a scaler, pulls them from an appsink and looks at every field.
"""
import sys

import gi
gi.require_version('Gst', '1.0')
gi.require_version('GstApp', '1.0')
gi.require_version('GstVideo', '1.0')
from gi.repository import Gst, GstApp, GstVideo  # noqa: E402,F401

WIDTH, HEIGHT, SCALED = 320, 240, (160, 120)
FIELDS = {'version': int, 'frame': int, 'frame-width': int, 'frame-height': int, 'horizon-row': int,
          'horizon-confidence': int, 'mask': Gst.Buffer, 'confidence': int, 'confidence-map': Gst.Buffer,
          'mask-x': int, 'mask-y': int, 'mask-w': int, 'mask-h': int, 'boundary': Gst.Buffer,
          'traversable-permille': int, 'window-x': int, 'window-y': int, 'window-w': int, 'window-h': int, 'model-generation': int, 'flags': int}


def content(buffer):
    ok, view = buffer.map(Gst.MapFlags.READ)
    assert ok
    data = bytes(view.data)
    buffer.unmap(view)
    return data


def check(sample, index):
    buffer = sample.get_buffer()
    meta = buffer.get_custom_meta('GstTerrainSegMeta')
    assert meta is not None, 'no metadata'
    s = meta.get_structure()
    for field, kind in FIELDS.items():
        assert isinstance(s.get_value(field), kind), f'{field}: {s.get_value(field)!r}'
    assert s.get_value('version') == 1
    assert s.get_value('frame') == index
    assert (s.get_value('frame-width'), s.get_value('frame-height')) == SCALED
    assert (s.get_value('mask-w'), s.get_value('mask-h')) == SCALED
    mask = s.get_value('mask')
    layout = GstVideo.buffer_get_video_meta(mask)
    assert (layout.width, layout.height) == (WIDTH, HEIGHT), 'the mask keeps its own size'
    assert layout.format == GstVideo.VideoFormat.GRAY8
    pixels = content(mask)
    assert len(pixels) == WIDTH * HEIGHT
    assert set(pixels) <= {0, 128, 255}, set(pixels)
    assert abs(pixels.count(255) * 1000 // len(pixels) - s.get_value('traversable-permille')) <= 1
    rows = memoryview(content(s.get_value('boundary'))).cast('H')
    assert len(rows) == WIDTH and max(rows) <= SCALED[1]
    sureness = s.get_value('confidence-map')
    layout = GstVideo.buffer_get_video_meta(sureness)
    assert (layout.width, layout.height) == (WIDTH // 4, HEIGHT // 4), 'the confidence map keeps its own size'
    cells = content(sureness)
    assert len(cells) == layout.width * layout.height and max(cells) > 100, max(cells)
    ok, models = s.get_list('models')
    assert ok
    for i in range(models.n_values):
        model = models.get_nth(i)
        ok, mean = model.get_array('mean')
        assert ok and mean.n_values == 3 and 0 <= mean.get_nth(0) <= 255
        assert model.get_value('mass') >= 0
    return s.get_value('model-generation'), models.n_values


def main():
    Gst.init(None)
    pipeline = Gst.parse_launch(
        f'videotestsrc num-buffers=5 ! video/x-raw,format=I420,width={WIDTH},height={HEIGHT} ! terrainseg ! '
        f'videoconvert ! video/x-raw,format=RGB ! videoscale ! video/x-raw,width={SCALED[0]},height={SCALED[1]} ! '
        'appsink name=sink sync=false')
    pipeline.set_state(Gst.State.PLAYING)
    sink = pipeline.get_by_name('sink')
    seen = []
    while (sample := sink.try_pull_sample(10 * Gst.SECOND)) is not None:
        seen.append(check(sample, len(seen)))
    pipeline.set_state(Gst.State.NULL)
    assert len(seen) == 5, seen
    generations = [generation for generation, _ in seen]
    assert generations == sorted(generations) and generations[-1] > 0, generations
    assert seen[-1][1] > 0, 'no model'


if __name__ == '__main__':
    sys.exit(main())
