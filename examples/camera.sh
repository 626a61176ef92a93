#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# A camera in a window, the traversable ground tinted. Old frames are dropped, so the picture is never late.
# usage: examples/camera.sh [DEVICE] | --self-test
#   DEVICE  such as /dev/video2 (default: the first camera); or set SOURCE to any source, such as libcamerasrc
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
