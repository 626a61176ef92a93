#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Sends H.264 and KLV over RTP from the rover, as an MPEG transport stream (RFC 2250). The receiver detects lost and reordered
# packets, and both streams share one clock. VLC and ffplay show it without an SDP file.
# usage: examples/stream_rtp.sh HOST [PORT] | --self-test           the receiver: ground_station.sh rtp://:PORT
. "$(dirname "$0")/common.sh"
case "${1:-}" in
  --help) usage ;;
  "") usage 2 ;;
  --self-test) port=$(free_port); link_test "rtp://:$port" "$0" 127.0.0.1 "$port"; exit ;;
esac
check_port "${2:-7010}"
rover "rtpmp2tpay ! udpsink host=$1 port=${2:-7010} sync=false"
