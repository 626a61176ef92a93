#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""What the page of terrainseg shows in Python: the proximity event from behind, ignore-regions, the learned terrain as a
file, messages and statistics, with the bindings that Debian ships."""
import pathlib
import sys
import tempfile

import gi
gi.require_version('Gst', '1.0')
gi.require_version('GstApp', '1.0')
from gi.repository import Gst, GstApp  # noqa: E402,F401

CAPS = 'video/x-raw,format=I420,width=160,height=120,framerate=30/1'


def near_event(clear):
    text = f'terrainseg-near, clear=(boolean){"true" if clear else "false"}'
    return Gst.Event.new_custom(Gst.EventType.CUSTOM_UPSTREAM, Gst.Structure.from_string(text)[0])


def main():
    Gst.init(None)
    pipeline = Gst.parse_launch(f'videotestsrc ! {CAPS} ! terrainseg name=seg post-messages=true ! '
                                'appsink name=sink sync=false max-buffers=1')
    element, sink = pipeline.get_by_name('seg'), pipeline.get_by_name('sink')
    Gst.util_set_object_arg(element, 'ignore-regions', '<<0,0,32,16>>')
    pipeline.set_state(Gst.State.PLAYING)

    def pull():
        sample = sink.try_pull_sample(10 * Gst.SECOND)
        assert sample is not None
        return sample.get_buffer().get_custom_meta('GstTerrainSegMeta').get_structure()

    def settled():
        """The metadata of a frame that was made after now: at most two are on their way."""
        for _ in range(4):
            s = pull()
        return s

    assert settled().get_value('model-generation') > 0
    ok, view = settled().get_value('mask').map(Gst.MapFlags.READ)
    assert ok and view.data[5 * 160 + 5] == 128, 'an ignored pixel is unknown'

    assert sink.send_event(near_event(False))
    assert element.get_property('near-clear') is False
    frozen = settled()
    assert frozen.get_value('flags') & 2, frozen.get_value('flags')
    assert settled().get_value('model-generation') == frozen.get_value('model-generation')
    assert sink.send_event(near_event(True))
    assert settled().get_value('model-generation') > frozen.get_value('model-generation')

    with tempfile.TemporaryDirectory() as folder:
        path = str(pathlib.Path(folder) / 'yard.terrain')
        assert element.emit('save-model', path) is True
        assert element.emit('load-model', path) is True
        assert element.emit('load-model', path + '.missing') is False
    element.emit('reset')

    stats = element.get_property('stats')
    assert stats.get_value('frames') > 10 and stats.get_value('skipped-near') > 0
    assert stats.get_value('total-median-us') > 0
    message = pipeline.get_bus().timed_pop_filtered(Gst.SECOND, Gst.MessageType.ELEMENT)
    structure = message.get_structure()
    assert structure.get_name() == 'terrainseg' and structure.get_value('blocked') in (True, False)
    warning = pipeline.get_bus().timed_pop_filtered(Gst.SECOND, Gst.MessageType.WARNING)
    assert 'yard.terrain.missing' in warning.parse_warning()[0].message
    pipeline.set_state(Gst.State.NULL)


if __name__ == '__main__':
    sys.exit(main())
