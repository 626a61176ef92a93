# SPDX-License-Identifier: LGPL-2.1-or-later
"""Finds the plugin for the programs in this folder, and reads videos for them. If it is installed, or GST_PLUGIN_PATH is set, Gst.init() is enough."""
import pathlib
import sys

import gi

gi.require_version('Gst', '1.0')
from gi.repository import Gst  # noqa: E402

BUILDS = ('build', 'build-release', 'build-quickstart')


def init():
    """Gst.init(). If GStreamer does not find terrainseg, loads the newest build in the source tree and names it on stderr."""
    Gst.init(None)
    if Gst.ElementFactory.find('terrainseg'):
        return
    top = pathlib.Path(__file__).resolve().parent.parent.parent
    plugins = [path for path in (top / name / 'gst' / 'libgstterrainseg.so' for name in BUILDS) if path.exists()]
    name = pathlib.Path(sys.argv[0]).name
    if not plugins:
        sys.exit(f'{name}: GStreamer does not find terrainseg, and there is no build in {top}: run examples/quickstart.sh, install it, '
                 'or set GST_PLUGIN_PATH')
    newest = max(plugins, key=lambda path: path.stat().st_mtime)
    Gst.Registry.get().scan_path(str(newest.parent))
    if not Gst.ElementFactory.find('terrainseg'):
        sys.exit(f'{name}: {newest} cannot be loaded: run GST_DEBUG=2 {name} for the reason')
    print(f'{name}: uses the plugin in {newest.parent.relative_to(top)}', file=sys.stderr)


def upright(video):
    """The source of a pipeline: the pictures of a recording, upright and progressive. The identity keeps GStreamer 1.26's FFmpeg decoders from
    decoding into videoflip's buffers, at which they abort at times."""
    return (f'uridecodebin uri="{pathlib.Path(video).resolve().as_uri()}" ! videoconvert ! deinterlace fields=top '
            '! identity drop-allocation=true ! videoflip video-direction=auto ! videoconvert')
