#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Shows a camera in a window with the traversable ground tinted. Drops old frames, so the picture is never late.
# usage: examples/camera.sh [DEVICE] | --self-test
#   DEVICE  such as /dev/video2 (default: the first camera)
# Environment: SOURCE  any other source, such as libcamerasrc          VIEW  where to show it, such as a file
#              SETTINGS  properties of terrainseg
. "$(dirname "$0")/common.sh"
case "${1:-}" in
  --help) usage ;;
  --self-test)
    SOURCE=$test_source VIEW="fakesink" LINES_TO= "$0" && echo "camera.sh: the pipeline runs to its end"
    exit ;;
  ?*) SOURCE="v4l2src device=$1 ! decodebin" ;;
esac
pipeline "$SOURCE ! videoconvert ! video/x-raw,format=NV12 ! queue leaky=downstream max-size-buffers=1 \
  ! terrainseg overlay=true post-messages=true $SETTINGS ! $VIEW"
