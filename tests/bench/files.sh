#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Times whole pipelines on a HD file: decode, decode + filter, decode + filter + encode, and the filter's share.
# Called by run.sh.   usage: files.sh [--quick] JSON     $TERRAINSEG_VIDEO: a file instead of the rendered scene
set -euo pipefail
frames=300
rounds=3
if [ "$1" = --quick ]; then
  frames=90
  rounds=1
  shift
fi
json=$1
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
video=${TERRAINSEG_VIDEO:-}
if [ -z "$video" ]; then
  video=$folder/scene.mp4
  gst-launch-1.0 -q terrainscenesrc num-buffers=$frames ! video/x-raw,format=I420,width=1920,height=1080,framerate=30/1 ! \
    x264enc speed-preset=veryfast bitrate=8000 ! h264parse ! mp4mux ! filesink location="$video"
fi

# cost PIPELINE...: microseconds of processor time, start-up included; the least of the rounds. Not the clock on the
# wall, which counts what else the machine does.
cost() {
  local best='' us
  for _ in $(seq $rounds); do
    us=$(
      TIMEFORMAT='%U %S'
      { time gst-launch-1.0 -q filesrc location="$video" ! decodebin ! video/x-raw ! "$@" >/dev/null; } 2>&1 |
        awk '{ printf "%d", ($1 + $2) * 1000000 }'
    )
    if [ -z "$best" ] || [ "$us" -lt "$best" ]; then best=$us; fi
  done
  echo "$best"
}
encode=(x264enc speed-preset=superfast tune=zerolatency bitrate=8000 ! fakesink)
decode_us=$(cost fakesink)
filter_us=$(cost terrainseg ! fakesink)
overlay_us=$(cost terrainseg overlay=true ! fakesink)
encode_us=$(cost "${encode[@]}")
all_us=$(cost terrainseg overlay=true ! "${encode[@]}")
count=$(gst-launch-1.0 filesrc location="$video" ! decodebin ! video/x-raw ! progressreport silent=true ! fakesink silent=false -v |
  grep -c 'last-message = chain')
/usr/bin/python3 - "$json" "$count" "$decode_us" "$filter_us" "$overlay_us" "$encode_us" "$all_us" <<'PY'
import json
import sys

path, count = sys.argv[1], int(sys.argv[2])
decode, filtered, overlaid, encode, everything = (int(us) / 1000 / count for us in sys.argv[3:])
rows = []
print('\nwhole pipelines on a HD file, ms a frame of processor time (%d frames)' % count)


def row(name, ms, floor, floor_ms):
    rows.append({'section': 'files', 'name': name, 'format': '', 'width': 0, 'height': 0, 'ms': ms, 'p99_ms': 0,
                 'floor': floor, 'floor_ms': floor_ms, 'ratio': ms / floor_ms, 'limit': 0, 'met': None})
    print(f'{name:<58} {ms:9.3f}  {floor_ms:9.3f} {ms / floor_ms:7.3f}  (against {floor})')


row('decode', decode, 'decode', decode)
row('decode, filter', filtered, 'decode', decode)
row('decode, filter, overlay', overlaid, 'decode', decode)
row('decode, encode', encode, 'decode', decode)
row('decode, filter, overlay, encode', everything, 'decode, encode', encode)
row('share of filter and overlay', everything - encode, 'decode, filter, overlay, encode', everything)
with open(path, 'w') as out:
    json.dump(rows, out)
PY
