#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# The rover's end of an RTP link: H.264 and KLV in an MPEG transport stream in RTP (RFC 2250), so that lost and reordered
# packets are noticed, and both streams keep one clock. VLC and ffplay show it without an SDP file.
# usage: examples/stream_rtp.sh HOST [PORT] | --self-test           the other end: ground_station.sh rtp://:PORT
. "$(dirname "$0")/common.sh"
case "${1:-}" in
  --help) usage ;;
  "") usage 2 ;;
  --self-test) link_test rtp://:17710 "$0" 127.0.0.1 17710; exit ;;
esac
pipeline "$SOURCE ! videoconvert ! video/x-raw,format=I420 ! queue leaky=downstream max-size-buffers=2 ! terrainseg $SETTINGS ! tee name=t \
  t. ! queue ! x264enc tune=zerolatency speed-preset=veryfast bitrate=4000 key-int-max=30 ! h264parse config-interval=-1 ! mux. \
  $(lines_branch) \
  t. ! queue ! terrainextract ! meta/x-klv,parsed=true ! mux. \
  mpegtsmux name=mux alignment=7 latency=100000000 ! rtpmp2tpay ! udpsink host=$1 port=${2:-7010} sync=false"
