#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# The rover's end of an RTP link: H.264 and KLV in an MPEG transport stream in RTP (RFC 2250), so that lost and reordered
# packets are noticed, and both streams keep one clock. VLC and ffplay show it without an SDP file.
# usage: examples/stream_rtp.sh HOST [PORT] | --self-test           the other end: ground_station.sh rtp://:PORT
. "$(dirname "$0")/common.sh"
case "${1:-}" in
  --help) usage ;;
  "") usage 2 ;;
  --self-test) port=$(free_port); link_test "rtp://:$port" "$0" 127.0.0.1 "$port"; exit ;;
esac
check_port "${2:-7010}"
rover "rtpmp2tpay ! udpsink host=$1 port=${2:-7010} sync=false"
