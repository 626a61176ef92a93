#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Makes the real pictures of docs/gallery.md and the README: best, median and worst frames of each set whose licence allows it.
# usage: lab/evaluation/gallery.sh [DATA]    DATA: a folder of sequences and sets of stills, default $TERRAINSEG_DATA
set -euo pipefail
top=$(cd "$(dirname "$0")/../.." && pwd)
data=${1:-${TERRAINSEG_DATA:-}}
[ -d "$data" ] || { echo "gallery.sh: give it a folder of labelled sequences, or set TERRAINSEG_DATA" >&2; exit 2; }
build=${TERRAINSEG_BUILD:-$top/build}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
# Sets under CC BY 4.0, MIT or BSD.
sets=(offroad campus_robot mars robots_misc indoor_rgbd corridor_popup)
"$build/lab/terrainseg-eval" --pictures "$work" "${sets[@]/#/$data/}" >"$work/table.md"
mkdir -p "$top/docs/images/gallery"
for set in "${sets[@]}"; do
  cp "$work/$set-sheet.jpg" "$top/docs/images/gallery/$set.jpg"
done
# The README's picture: a trail, through the element, the bonnet cut off.
GST_PLUGIN_PATH=$build/gst GST_REGISTRY=$work/registry gst-launch-1.0 -q filesrc location="$data/offroad/frames/0215.$(ls "$data/offroad/frames" | head -n 1 | sed 's/.*\.//')" \
  ! decodebin ! videocrop bottom=64 ! imagefreeze num-buffers=4 ! videoconvert ! video/x-raw,format=I420 ! terrainseg overlay=true ! jpegenc quality=88 \
  ! multifilesink location="$work/trail%d.jpg"
cp "$work/trail3.jpg" "$top/docs/images/gallery/trail.jpg"
sed -n '/section engines/,/^<!-- section [^e]/p' "$work/table.md"
