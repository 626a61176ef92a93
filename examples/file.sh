#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Writes a video with the traversable ground tinted, as H.264 in MP4. For many files, masks and resuming: terrainseg-process.
# usage: examples/file.sh VIDEO OUTPUT.mp4 | --self-test
. "$(dirname "$0")/common.sh"
uri_of() { /usr/bin/python3 -c 'import pathlib, sys; print(pathlib.Path(sys.argv[1]).resolve().as_uri())' "$1"; }
range_of() { ffprobe -v error -select_streams V:0 -show_entries stream=color_range -of csv=p=0 "$1" 2>/dev/null | head -1 || true; }
case "${1:-}" in
  --help) usage ;;
  --self-test)
    folder=$(mktemp -d)
    trap 'rm -r "$folder"' EXIT
    gst-launch-1.0 -q -e terrainscenesrc num-buffers=45 ! video/x-raw,format=I420,width=320,height=180 ! x264enc ! mp4mux \
      ! filesink "location=$folder/in put.mp4"
    "$0" "$folder/in put.mp4" "$folder/out put.mp4"
    frames=$(ffprobe -v error -count_frames -show_entries stream=nb_read_frames -of csv=p=0 "$folder/out put.mp4")
    echo "file.sh: 45 frames in, $frames frames out"
    [ "$frames" -eq 45 ] || fail "frames are missing"
    gst-launch-1.0 -q -e videotestsrc num-buffers=9 ! video/x-raw,format=I420,width=320,height=180,colorimetry=1:3:5:1 \
      ! x264enc ! mp4mux ! filesink "location=$folder/full.mp4"
    "$0" "$folder/full.mp4" "$folder/out.mp4" 2>"$folder/said"
    [ "$(range_of "$folder/out.mp4")" = pc ] || grep -q "full range" "$folder/said" || fail "the range is lost without a word"
    exit ;;
esac
[ $# -eq 2 ] || usage 2
[ -r "$1" ] || fail "$1 cannot be read"
[ ! "$1" -ef "$2" ] || fail "$2 is the video itself: name another file for the result"
# Written beside it first: what was there before stays until the new one is whole.
part=$2.part
has_frames() {
  /usr/bin/python3 -c 'import mmap, sys
with open(sys.argv[1], "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
    at = data.rfind(b"stsz")  # the sizes of the samples: after eight bytes how many there are
    sys.exit(at < 0 or not int.from_bytes(data[at + 12:at + 16], "big"))' "$1"
}
# end_when_idle PROCESS: kills a process that has used no processor time for 20 seconds. gst-launch-1.0 of GStreamer 1.26 sometimes
# misses an error that comes before it listens, and waits for ever.
end_when_idle() {
  local used before='' idle=0
  while sleep 1 && used=$(cut -d' ' -f14,15 "/proc/$1/stat" 2>/dev/null); do
    if [ "$used" = "$before" ]; then idle=$((idle + 1)); else idle=0; fi
    before=$used
    [ "$idle" -lt 20 ] || kill -KILL "$1"
  done
}
# The first videoconvert is for formats that videoflip does not turn; H.264 wants even sides, MP4 sides of 16 and more.
if ! (launched=$BASHPID; end_when_idle "$launched" & pipeline "uridecodebin uri=$(uri_of "$1") ! videoconvert ! deinterlace fields=top \
  ! identity drop-allocation=true ! videoflip video-direction=auto ! videoconvert ! terrainseg overlay=true $SETTINGS ! videoconvert ! videoscale \
  ! video/x-raw,format=I420,width=[16,32766,2],height=[16,32766,2] ! x264enc pass=qual speed-preset=veryfast ! mp4mux \
  ! filesink location=$(quoted "$part")") || ! has_frames "$part"; then
  rm -f "$part"
  fail "no video came out of $1"
fi
mv "$part" "$2"
if [ "$(range_of "$2")" = tv ] && [ "$(range_of "$1")" = pc ]; then
  echo "file.sh: the colours of $2 differ from those of $1: it has full range, which GStreamer 1.22 does not read from MP4; \
terrainseg-process --outputs annotated converts it" >&2
fi
