#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Receives video and KLV, attaches the metadata to the frames again and draws it in a window.
# usage: examples/ground_station.sh srt://ROVER:PORT | udp://:PORT | rtp://:PORT | --self-test
#   LINES_TO=FILE writes one JSON object per frame
. "$(dirname "$0")/common.sh"
case "${1:-}" in
  --help) usage ;;
  "") usage 2 ;;
  --self-test) exec "$here/stream_srt.sh" --self-test ;;
esac
uri=$1
# The words of the pipeline are those of this file; of the URI only what an address may hold gets into them.
[[ $uri =~ ^(srt://[A-Za-z0-9._-]+|srt://\[[0-9A-Fa-f:.]+\]|udp://|rtp://):([0-9]{1,5})$ ]] || fail "$uri is not srt://ROVER:PORT, udp://:PORT or rtp://:PORT"
port=${BASH_REMATCH[2]}
check_port "$port"
case "$uri" in
  srt://*)
    check_passphrase
    secret=${SRT_PASSPHRASE:+"passphrase=$(quoted "$SRT_PASSPHRASE") pbkeylen=16"}
    input="srtsrc uri=$uri?mode=caller $secret ! tsdemux name=d  d. ! h264parse ! terrainstamp mode=read ! video.  d. ! meta/x-klv ! klv." ;;
  udp://*)
    input="udpsrc port=$port buffer-size=2000000 caps=video/mpegts,systemstream=true,packetsize=188 ! tsdemux name=d \
      d. ! h264parse ! terrainstamp mode=read ! video.  d. ! meta/x-klv ! klv." ;;
  rtp://*)
    input="udpsrc port=$port buffer-size=2000000 caps=application/x-rtp,media=video,clock-rate=90000,encoding-name=MP2T,payload=33 \
      ! rtpjitterbuffer latency=100 ! rtpmp2tdepay ! tsdemux name=d  d. ! h264parse ! terrainstamp mode=read ! video.  d. ! meta/x-klv ! klv." ;;
  *) usage 2 ;;
esac
echo "ground_station.sh: waiting for video and KLV from $uri (start examples/stream_*.sh on the rover); Ctrl-C ends it" >&2
pipeline "$input queue name=video ! avdec_h264 ! c.sink  queue name=klv ! c.meta \
  terraincombine name=c ! tee name=t  t. ! queue ! terrainoverlay ! $VIEW  $(lines_branch)"
