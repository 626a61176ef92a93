#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Sends H.264 and one KLV unit per frame over UDP from the rover, as an MPEG transport stream.
# usage: examples/stream_udp_ts.sh HOST [PORT] | --self-test        the receiver: ground_station.sh udp://:PORT
. "$(dirname "$0")/common.sh"
case "${1:-}" in
  --help) usage ;;
  "") usage 2 ;;
  --self-test) port=$(free_port); link_test "udp://:$port" "$0" 127.0.0.1 "$port"; exit ;;
esac
check_port "${2:-7000}"
rover "udpsink host=$1 port=${2:-7000} sync=false"
