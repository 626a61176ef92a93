#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Runs a pipeline as gst-launch-1.0 -q -e does, and keeps the counts of its terrainros2sink, named ros2, in a file, four times a second:
frames that passed, messages that DDS did not accept, messages on its topics taken and refused.

usage: rover.py COUNTS PIPELINE...
"""
import os
import signal
import sys

import gi

gi.require_version('Gst', '1.0')
from gi.repository import GLib, Gst  # noqa: E402

Gst.init(None)
counts = sys.argv[1]
pipeline = Gst.parse_launchv(sys.argv[2:])
sink, loop = pipeline.get_by_name('ros2'), GLib.MainLoop()


def keep():
    stats = sink.get_property('stats')
    fields = [stats.get_value(stats.nth_field_name(i)) for i in range(stats.n_fields())]
    dropped = sum(each.get_value('dropped') for each in fields if isinstance(each, Gst.Structure))
    with open(counts + '.part', 'w') as file:
        print(stats.get_value('frames'), dropped, stats.get_value('messages-taken'), stats.get_value('messages-refused'), file=file)
    os.replace(counts + '.part', counts)
    return True


def on_message(_bus, message):
    if message.type == Gst.MessageType.ERROR:
        print(f'rover.py: {message.parse_error()[0].message}', file=sys.stderr, flush=True)
        os._exit(1)
    if message.type == Gst.MessageType.EOS:
        loop.quit()


pipeline.get_bus().add_signal_watch()
pipeline.get_bus().connect('message', on_message)
GLib.unix_signal_add(GLib.PRIORITY_HIGH, signal.SIGINT, lambda: pipeline.send_event(Gst.Event.new_eos()) or True)
GLib.timeout_add(250, keep)
pipeline.set_state(Gst.State.PLAYING)
loop.run()
keep()
pipeline.set_state(Gst.State.NULL)
