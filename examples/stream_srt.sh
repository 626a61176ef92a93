#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# The rover's end of an SRT link, which repeats what the radio lost: H.264 and KLV in an MPEG transport stream. Waits for
# a ground station to call. Encrypted when SRT_PASSPHRASE (10 to 79 characters) is set at both ends.
# usage: examples/stream_srt.sh [PORT] | --self-test                the other end: ground_station.sh srt://ROVER:PORT
. "$(dirname "$0")/common.sh"
case "${1:-}" in
  --help) usage ;;
  --self-test)
    export SRT_PASSPHRASE="only for this test"
    may_lose_at_end=8
    link_test srt://127.0.0.1:17701 "$0" 17701
    exit ;;
esac
secret=${SRT_PASSPHRASE:+"passphrase=\"\$SRT_PASSPHRASE\" pbkeylen=16"}
pipeline "$SOURCE ! videoconvert ! video/x-raw,format=I420 ! queue leaky=downstream max-size-buffers=2 ! terrainseg $SETTINGS ! tee name=t \
  t. ! queue ! x264enc tune=zerolatency speed-preset=veryfast bitrate=4000 key-int-max=30 ! h264parse config-interval=-1 ! mux. \
  $(lines_branch) \
  t. ! queue ! terrainextract ! meta/x-klv,parsed=true ! mux. \
  mpegtsmux name=mux alignment=7 latency=100000000 ! srtsink uri=srt://:${1:-7001}?mode=listener wait-for-connection=true $secret"
