#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# The rover's end of a UDP link: H.264 and one KLV unit per frame in an MPEG transport stream.
# usage: examples/stream_udp_ts.sh HOST [PORT] | --self-test        the other end: ground_station.sh udp://:PORT
. "$(dirname "$0")/common.sh"
case "${1:-}" in
  --help) usage ;;
  "") usage 2 ;;
  --self-test) link_test udp://:17700 "$0" 127.0.0.1 17700; exit ;;
esac
# A leaky queue belongs before terrainseg only: behind it video and metadata must stay together.
pipeline "$SOURCE ! videoconvert ! video/x-raw,format=I420 ! queue leaky=downstream max-size-buffers=2 ! terrainseg $SETTINGS ! tee name=t \
  t. ! queue ! x264enc tune=zerolatency speed-preset=veryfast bitrate=4000 key-int-max=30 ! h264parse config-interval=-1 ! mux. \
  $(lines_branch) \
  t. ! queue ! terrainextract ! meta/x-klv,parsed=true ! mux. \
  mpegtsmux name=mux alignment=7 latency=100000000 ! udpsink host=$1 port=${2:-7000} sync=false"
