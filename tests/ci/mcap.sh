#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Recordings read by other implementations, strictly and with every checksum: npm's @mcap/core, fzstd and
# @foxglove/rosmsg2-serialization. Values are those of the JSON lines; a killed recorder leaves a prefix that reads. Slow: fetches packages.
# usage: tests/ci/mcap.sh [BUILD_FOLDER]
#   BUILD_FOLDER  a build that is there (default: build-release, else build)
# Without npm, or without a way to the packages, it says so and ends with 77: skipped.
set -euo pipefail
cd "$(dirname "$0")/../.."
build=${1:-build-release}
[ -d "$build" ] || build=build
for need in gst/libgstterrainseg.so gst/libgstterrainmcap.so src/tools/terrainseg-process; do
  [ -e "$build/$need" ] || { echo "mcap.sh: $build holds no $need: ninja -C $build $need (it takes libzstd-dev)" >&2; exit 1; }
done
command -v npm >/dev/null && command -v node >/dev/null || { echo "mcap.sh: skipped: npm and node are not there"; exit 77; }
build=$(cd "$build" && pwd)
checker=$PWD/tests/ci/mcap_check.mjs
folder=$(mktemp -d)
recorder=
# shellcheck disable=SC2317
leave() { [ -z "$recorder" ] || kill -9 "$recorder" 2>/dev/null || true; rm -rf "$folder"; }
trap leave EXIT
export GST_PLUGIN_PATH=$build/gst GST_REGISTRY=$folder/registry.bin
cd "$folder"
npm install --silent --no-audit --no-fund --ignore-scripts @mcap/core@2.2.2 @foxglove/rosmsg@5.0.5 \
  @foxglove/rosmsg2-serialization@3.1.0 fzstd@0.1.1 >npm.log 2>&1 || {
  echo "mcap.sh: skipped: npm cannot fetch the readers: $(tail -n 1 npm.log)"
  exit 77
}
cp "$checker" check.mjs
# The calibration of the scene `road`: 0.82 widths of focal length, 1.35 m, a horizon at 43 % of the height.
cat >camera.yaml <<'YAML'
image_width: 320
image_height: 180
camera_matrix: {rows: 3, cols: 3, data: [262.4, 0, 159.5, 0, 262.4, 89.5, 0, 0, 1]}
YAML
mount=height=1.35,pitch=2.75deg,x=0.2

# A file: ten seconds with the time of day.
gst-launch-1.0 -q terrainscenesrc num-buffers=300 ! video/x-raw,width=320,height=180,framerate=30/1 ! x264enc speed-preset=veryfast ! h264parse \
  ! mp4mux ! filesink location=drive.mp4
"$build/src/tools/terrainseg-process" -q -o out --outputs mcap,json --json-mask --camera-info camera.yaml --mount $mount \
  --set start-time=2026-11-21T20:00:00Z drive.mp4
node check.mjs whole out/drive.bag/terrain.mcap out/drive.jsonl 300
# The check itself can fail: bytes in the middle of a chunk, a line of another frame.
cp out/drive.bag/terrain.mcap damaged.mcap
printf 'not what was here' | dd of=damaged.mcap bs=1 seek=50000 conv=notrunc status=none
if node check.mjs whole damaged.mcap out/drive.jsonl 300 >/dev/null 2>&1; then echo "mcap.sh: damaged bytes are not seen"; exit 1; fi
{ sed 1d out/drive.jsonl; head -n 1 out/drive.jsonl; } >turned.jsonl
if node check.mjs whole out/drive.bag/terrain.mcap turned.jsonl 300 >/dev/null 2>&1; then echo "mcap.sh: lines of other frames are not seen"; exit 1; fi

# Live, in stream time, beside the lines of the same frames; stopped by Ctrl-C.
live() { # live LOCATION LINES
  exec gst-launch-1.0 -q -e terrainscenesrc is-live=true ! video/x-raw,width=320,height=180,framerate=30/1 ! terrainseg camera-info=camera.yaml mount=$mount \
    ! tee name=t t. ! queue ! terrainextract json-mask=true ! application/x-ndjson ! filesink location="$2" \
    t. ! queue ! x264enc bframes=0 tune=zerolatency key-int-max=30 ! h264parse ! terrainmcapsink location="$1" camera-info=camera.yaml mount=$mount
}
live live live.jsonl &
recorder=$!
sleep 6
kill -INT "$recorder"
wait "$recorder"
recorder=
[ -e live/metadata.yaml ] && [ ! -e live/live_0.mcap.part ] || { echo "mcap.sh: the live bag is not whole: $(ls live)"; exit 1; }
node check.mjs whole live/live_0.mcap live.jsonl 20

# Killed: a .part that reads as far as its last whole chunk.
live killed.mcap killed.jsonl &
recorder=$!
sleep 6
kill -9 "$recorder"
wait "$recorder" 2>/dev/null || true
recorder=
[ -e killed.mcap.part ] && [ ! -e killed.mcap ] || { echo "mcap.sh: after kill -9 there is $(ls)"; exit 1; }
node check.mjs prefix killed.mcap.part 20

# A full disk.
if gst-launch-1.0 terrainscenesrc num-buffers=60 ! terrainseg ! terrainmcapsink fd=3 3>/dev/full >full.log 2>&1 || ! grep -q 'No space left on device' full.log; then
  echo "mcap.sh: a full disk is not told: $(tail -n 3 full.log)"
  exit 1
fi
echo "a full disk: $(grep -m 1 'No space left' full.log)"
