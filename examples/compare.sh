#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Shows terrainseg (left) and the unmodified algorithm, terrainreference (right), on the same pictures.
# Needs a build with the lab (OpenCV, Eigen): docs/tasks/installing.md.
# usage: examples/compare.sh | --self-test
# Environment: SOURCE  the source of the pictures (default: the rendered scene)     VIEW  where to show them (default: a window)
#              SETTINGS  properties of terrainseg       REFERENCE_SETTINGS  properties of terrainreference
#              WIDTH, HEIGHT  the size that both process (default: 640 and 360)
SOURCE=${SOURCE:-terrainscenesrc is-live=true scene=road light=drift}
WIDTH=${WIDTH:-640}
HEIGHT=${HEIGHT:-360}
. "$(dirname "$0")/common.sh"
case "${1:-}" in
  --help) usage ;;
  --self-test)
    folder=$(mktemp -d)
    trap 'rm -r "$folder"' EXIT
    for half in left right; do
      crop=$([ $half = left ] && echo "right=320" || echo "left=320")
      SOURCE="terrainscenesrc num-buffers=20" WIDTH=320 HEIGHT=180 \
        VIEW="videocrop $crop ! video/x-raw,width=320 ! filesink location=$folder/$half" "$0"
    done
    frames=$(($(stat -c %s "$folder/left") / (320 * 180 * 3 / 2)))
    echo "compare.sh: $frames frames, both halves drawn on"
    [ "$frames" -eq 20 ] || fail "frames are missing"
    ! cmp -s "$folder/left" "$folder/right" || fail "both halves are the same"
    exit ;;
  "") ;;
  *) usage 2 ;;
esac
pipeline "$SOURCE ! videoconvert ! videoscale ! video/x-raw,format=I420,width=$WIDTH,height=$HEIGHT ! tee name=t \
  t. ! queue ! terrainseg overlay=true $SETTINGS ! side.sink_0 \
  t. ! queue ! terrainreference overlay=true ${REFERENCE_SETTINGS:-} ! side.sink_1 \
  compositor name=side sink_1::xpos=$WIDTH ! videoconvert ! video/x-raw,format=I420 ! $VIEW"
