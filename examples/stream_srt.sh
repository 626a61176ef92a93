#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Sends H.264 and KLV over SRT from the rover, as an MPEG transport stream. SRT repeats lost packets. Waits until a ground
# station connects. Encrypted if SRT_PASSPHRASE (10 to 79 characters) is set at both ends.
# usage: examples/stream_srt.sh [PORT] | --self-test                the receiver: ground_station.sh srt://ROVER:PORT
. "$(dirname "$0")/common.sh"
case "${1:-}" in
  --help) usage ;;
  --self-test)
    export SRT_PASSPHRASE="only for this test"
    may_lose_at_end=8
    port=$(free_port)
    link_test "srt://127.0.0.1:$port" "$0" "$port"
    exit ;;
esac
check_port "${1:-7001}"
check_passphrase
secret=${SRT_PASSPHRASE:+"passphrase=$(quoted "$SRT_PASSPHRASE") pbkeylen=16"}
rover "srtsink uri=srt://:${1:-7001}?mode=listener wait-for-connection=true $secret"
