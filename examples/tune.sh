#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Opens a window to tune the filter: the overlay on the left, settings and numbers on the right.
# usage: examples/tune.sh VIDEO|camera|scene [PROPERTY=VALUE...] [--settings FILE]
#        examples/tune.sh VIDEO|camera|scene --picture FILE.png [--try PROPERTY=A:B:C] [--frames N]     without a display
# In the window: drag with the left button to set the training window, with the right button to set a region to ignore; right
# click a region to remove it. Drag with the middle button, or press h, to set the line at which level ground ends; n removes
# it. 1..9 and 0 choose a property, + and - change it, Backspace resets it to the preset. Space pauses, the full stop steps by
# a frame, r forgets what was learned, l switches learning on or off, q quits.
# On exit it prints the gst-launch-1.0 line and writes FILE (default: terrainseg.settings) for settings-location and
# terrainseg-process --set settings-location=FILE. If FILE exists, its settings are used at the start. SOURCE is the camera.
given_source=${SOURCE:-}
. "$(dirname "$0")/common.sh"
[ "${1:-}" != --help ] || usage
[ $# -gt 0 ] || usage 2
[ -z "$given_source" ] || export SOURCE="$given_source"
exec /usr/bin/python3 "$here/python/tune.py" "$@"
