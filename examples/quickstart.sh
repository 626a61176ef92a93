#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Installs what is missing, builds the filter and runs it once, on VIDEO or on a scene that it renders itself.
# usage: examples/quickstart.sh [VIDEO]
# leaves quickstart/annotated.mp4 (H.264), quickstart/masks.mkv (FFV1, GRAY8), quickstart/terrain.jsonl and
# quickstart/preview.png, a contact sheet: annotated frames above, their masks below.
set -euo pipefail
top=$(cd "$(dirname "$0")/.." && pwd)
fail() { echo "quickstart: $*" >&2; exit 1; }

usage() { sed -n '3,6s/^# //p' "$0"; exit "$1"; }
case "${1:-}" in --help | -h) usage 0 ;; esac
[ $# -le 1 ] || usage 2
video=${1:-}
if [ -n "$video" ]; then
  [ -f "$video" ] && [ -r "$video" ] || fail "$video is not a file that can be read"
  video=$(realpath "$video")
fi

cd "$top"
./install-dependencies.sh plugin run preview

build=$top/build-quickstart
[ -f "$build/build.ninja" ] || meson setup "$build" -Dtests=false -Dtools=disabled -Dbench=disabled >"$build.log" 2>&1 ||
  { tail -n 20 "$build.log" >&2; fail "could not configure the build; the whole log is $build.log"; }
echo "building ..."
ninja -C "$build" >"$build.log" 2>&1 || { tail -n 20 "$build.log" >&2; fail "could not build; the whole log is $build.log"; }
export GST_PLUGIN_PATH=$build/gst GST_REGISTRY=$build/registry.bin
gst-inspect-1.0 terrainseg >/dev/null || fail "GStreamer does not find the plugin in $build/gst"

if [ -n "$video" ]; then
  uri=$(/usr/bin/python3 -c 'import pathlib, sys; print(pathlib.Path(sys.argv[1]).as_uri())' "$video")
  source=(uridecodebin "uri=$uri" ! deinterlace ! videoflip method=automatic
          ! videoconvert)
  echo "running the filter on $video ..."
else
  source=(terrainscenesrc num-buffers=250 ! video/x-raw,width=640,height=360,framerate=30/1)
  echo "running the filter on a rendered scene ..."
fi

# Only what is whole gets its name: whatever stops this run, what the last one left is still there.
results=$top/quickstart
mkdir -p "$results"
out=$(mktemp -d "$results/unfinished-XXXXXX")
trap 'rm -rf "$out"' EXIT
begin=$(date +%s%N)
# One decoding, one filter, three ways out. The tee stands still until all three have begun: tune=zerolatency, or x264enc
# would look 50 frames ahead before its first one. (async=false instead loses the end of the stream behind decodebin.)
gst-launch-1.0 -q -e "${source[@]}" ! terrainseg ! tee name=t \
  t. ! queue ! terrainoverlay ! videoconvert ! video/x-raw,format=I420 ! x264enc tune=zerolatency speed-preset=veryfast bitrate=6000 \
     ! h264parse ! mp4mux ! filesink "location=\"$out/annotated.mp4\"" \
  t. ! queue ! terrainextract ! video/x-raw,format=GRAY8 ! avenc_ffv1 ! matroskamux ! filesink "location=\"$out/masks.mkv\"" \
  t. ! queue ! terrainextract ! application/x-ndjson ! filesink "location=\"$out/terrain.jsonl\"" ||
  fail "the pipeline stopped: see the message above"
end=$(date +%s%N)

frames=$(wc -l <"$out/terrain.jsonl")
[ "$frames" -gt 0 ] || fail "no frame came out of ${video:-the scene}: is there a video stream in it?"

# Six frames from all over the clip, and their masks.
every=$(((frames + 5) / 6))
pick="select='not(mod(n\\,$every))',scale=426:-2,tile=3x2:padding=4"
ffmpeg -nostdin -v error -y -i "$out/annotated.mp4" -i "$out/masks.mkv" -filter_complex \
  "[0:v]${pick}[a];[1:v]format=gray,${pick/scale=426:-2/scale=426:-2:flags=neighbor},format=rgb24[b];[a]format=rgb24[c];[c][b]vstack" \
  -frames:v 1 "$out/preview.png" || fail "ffmpeg could not make the contact sheet"

/usr/bin/python3 - "$out/terrain.jsonl" "$((end - begin))" <<'PYTHON'
import json, sys
lines = [json.loads(line) for line in open(sys.argv[1])]
seconds = int(sys.argv[2]) / 1e9
share = 100 * sum(line['traversable'] for line in lines) / len(lines)
print(f'{len(lines)} frames of {lines[0]["width"]}x{lines[0]["height"]} in {seconds:.1f} s: '
      f'{len(lines) / seconds:.0f} frames per second, with decoding and encoding')
print(f'traversable: {share:.0f} % of the view')
PYTHON
for name in annotated.mp4 masks.mkv terrain.jsonl preview.png; do
  mv "$out/$name" "$results/$name"
  echo "$results/$name"
done
