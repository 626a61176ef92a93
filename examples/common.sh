# SPDX-License-Identifier: LGPL-2.1-or-later
# Shared by the scripts in this folder, which source it.
#
#   SOURCE    the source of the pictures, a part of a pipeline      (default: the first camera)
#   VIEW      where they are shown                                  (default: a window)
#   LINES_TO  a file for one JSON object per frame                  (default: none)
#   SETTINGS  properties of terrainseg, as in gst-launch-1.0        (default: none)
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
SOURCE=${SOURCE:-v4l2src ! decodebin}
VIEW=${VIEW:-videoconvert ! autovideosink}
SETTINGS=${SETTINGS:-}

fail() { echo "$(basename "$0"): $*" >&2; exit 1; }
usage() { sed -n '3,/^[^#]/s/^# \{0,1\}//p' "$0"; exit "${1:-0}"; }

# use_plugin: keeps GST_PLUGIN_PATH if it is set, else uses the newest build in the source tree, else the installed plugin.
use_plugin() {
  local plugin newest=""
  [ -z "${GST_PLUGIN_PATH:-}" ] || return 0
  for plugin in "$here"/../build{,-release,-quickstart}/gst/libgstterrainseg.so; do
    if [ -e "$plugin" ] && { [ -z "$newest" ] || [ "$plugin" -nt "$newest" ]; }; then newest=$plugin; fi
  done
  if [ -n "$newest" ]; then
    local folder
    folder=$(cd "$(dirname "$newest")" && pwd)
    export GST_PLUGIN_PATH=$folder:${folder%/gst}/lab
    echo "$(basename "$0"): uses the plugin in ${folder#"$(dirname "$here")"/}" >&2
  elif gst-inspect-1.0 terrainseg >/dev/null 2>&1; then # --exists wants a plugin with the version of GStreamer
    echo "$(basename "$0"): uses the plugin that is installed" >&2
  else
    fail "GStreamer does not find terrainseg, and there is no build in $(dirname "$here"): run examples/quickstart.sh, install it, or set GST_PLUGIN_PATH"
  fi
}
[[ " $* " == *" --help "* ]] || use_plugin

# quoted TEXT: quotes any text as one word of a pipeline.
quoted() {
  local text=${1//\\/\\\\}
  printf '"%s"' "${text//\"/\\\"}"
}

# check_port TEXT: needed because gst-launch-1.0 only warns of an invalid port and continues with another one.
check_port() {
  { [[ $1 =~ ^[0-9]{1,5}$ ]] && [ "$((10#$1))" -ge 1 ] && [ "$((10#$1))" -le 65535 ]; } || fail "'$1' is not a port: 1 to 65535"
}

# check_passphrase: accepts a passphrase that is valid for SRT, or none.
check_passphrase() {
  local length=${#SRT_PASSPHRASE}
  [ "$length" -eq 0 ] || { [ "$length" -ge 10 ] && [ "$length" -le 79 ]; } ||
    fail "SRT_PASSPHRASE has $length characters; SRT takes 10 to 79: set the same at both ends"
}
SRT_PASSPHRASE=${SRT_PASSPHRASE:-}

# lines_branch: a branch of the tee named t that writes one JSON object per frame to LINES_TO, if that is set.
lines_branch() {
  [ -z "${LINES_TO:-}" ] || printf '%s' "t. ! queue ! terrainextract ! application/x-ndjson ! filesink location=$(quoted "$LINES_TO") \
    buffer-mode=unbuffered sync=false async=false"
}

# show_warnings: gst-launch-1.0 -q hides warnings too. The log has two lines for each: the first one is shown in the form of
# gst-launch-1.0, the rest of the log is hidden. If GST_DEBUG is set, the whole log is shown.
show_warnings() {
  [ -z "${GST_DEBUG:-}" ] || return 0
  export GST_DEBUG='terrain*:2' GST_DEBUG_NO_COLOR=1
  exec 2> >(
    trap '' INT # it goes on until gst-launch-1.0 has ended
    exec sed -unE '
      /^[0-9]+:[0-9]{2}:[0-9.]+ +[0-9]+ +0x/!{p;b}
      / WARN .* warning: /!b
      s/^.* ([^ ]+:[0-9]+:[^ ]*<([^>]*)>) warning: (.*)$/\1\n\2: \3/
      G
      /^([^\n]*)\n.*\n\1$/{s/.*//;h;b}
      h;x;s/\n.*//;x
      s/^[^\n]*\n([^\n]*)\n.*$/WARNING: from element \1/p' >&2
  )
}

# check_ends TEXT: checks that the pipeline's camera and display exist. Without a display autovideosink may crash without a
# message: Debian 12's DirectFB sink does.
check_ends() {
  local camera=/dev/video0
  if [[ " $1 " =~ [[:space:]]v4l2src[[:space:]]+(device=([^[:space:]]+)[[:space:]])? ]]; then
    [ -z "${BASH_REMATCH[2]:-}" ] || camera=${BASH_REMATCH[2]}
    [ -e "$camera" ] || fail "there is no camera $camera: set SOURCE to another one, such as SOURCE='v4l2src device=/dev/video2 ! decodebin', \
or try without one: SOURCE='terrainscenesrc is-live=true ! video/x-raw,framerate=30/1'"
  fi
  if [[ " $1 " == *" autovideosink "* ]] && [ -z "${DISPLAY:-}${WAYLAND_DISPLAY:-}" ] &&
    [ ! -S "${XDG_RUNTIME_DIR:-/run}/wayland-0" ] && ! compgen -G '/dev/dri/card*' >/dev/null; then
    fail "there is no display to show the video on: set DISPLAY, or set VIEW to something else, such as \
VIEW='videoconvert ! video/x-raw,format=I420 ! x264enc ! mp4mux ! filesink location=seen.mp4'"
  fi
}

# pipeline TEXT: runs it; Ctrl-C ends it properly. No shell parses the text: gst-launch-1.0 joins the words again and parses
# the quotes itself.
pipeline() {
  local words
  mapfile -d ' ' -t words <<<"${1//$'\n'/ }"
  words[-1]=${words[-1]%$'\n'}
  check_ends "${words[*]}"
  show_warnings
  exec gst-launch-1.0 -q -e "${words[@]}"
}

# rover SINK: the rover's end of a link: H.264 and one KLV unit per frame in an MPEG transport stream, into SINK.
# The leaky queue must be before terrainseg: behind it, video and metadata must stay together.
rover() {
  pipeline "$SOURCE ! videoconvert ! video/x-raw,format=I420 ! queue leaky=downstream max-size-buffers=2 ! terrainseg $SETTINGS ! tee name=t \
    t. ! queue ! x264enc tune=zerolatency speed-preset=veryfast bitrate=4000 key-int-max=30 ! h264parse config-interval=-1 ! terrainstamp ! mux. \
    $(lines_branch) \
    t. ! queue ! terrainextract ! meta/x-klv,parsed=true ! mux. \
    mpegtsmux name=mux alignment=7 latency=100000000 ! $1"
}

# A rendered scene in real time instead of the camera.
test_frames=90
test_source="terrainscenesrc is-live=true num-buffers=$test_frames ! video/x-raw,format=I420,width=320,height=180,framerate=30/1"

# stop PID: does what Ctrl-C does, for a pipeline without an end of its own. If nothing was ever received, the pipeline does not
# end; then does what a second Ctrl-C does.
stop() {
  kill -INT "$1" 2>/dev/null || true
  for _ in $(seq 50); do
    kill -0 "$1" 2>/dev/null || break
    sleep 0.1
  done
  kill -INT "$1" 2>/dev/null || true
  wait "$1" || true
}

# Closing an SRT connection drops the data that is younger than its latency: a stream may lose that much at its end.
may_lose_at_end=0

# free_port: prints an unused UDP port, so that tests can run side by side.
free_port() {
  /usr/bin/python3 -c 'import socket; s = socket.socket(type=socket.SOCK_DGRAM); s.bind(("", 0)); print(s.getsockname()[1])'
}

# link_test RECEIVER_URI SENDER ARGUMENTS...: runs a sender against ground_station.sh on this machine; every frame that
# was sent must come through with the metadata that it left with. No link repeats what a busy machine does not fetch in
# time, so a second run decides when the first was not whole.
link_test() {
  link_once "$@" || { echo "$(basename "$0"): once more"; link_once "$@"; }
}

link_once() {
  local uri=$1 folder receiver status=0
  shift
  folder=$(mktemp -d)
  VIEW="fakesink sync=false" LINES_TO=$folder/received "$here/ground_station.sh" "$uri" &
  receiver=$!
  sleep 1
  if ! SOURCE=$test_source SETTINGS="mask-level=1" LINES_TO=$folder/sent "$@"; then
    stop "$receiver"
    rm -r "$folder"
    fail "the sender failed"
  fi
  # The last frames wait in jitter buffers, and in a demuxer and a decoder until the end: so until all are there, or none came for 1.5 s.
  local received=-1 before still=0
  for _ in $(seq 100); do
    before=$received received=$(wc -l <"$folder/received")
    if [ "$received" = "$before" ]; then still=$((still + 1)); else still=0; fi
    if [ "$received" -ge "$(wc -l <"$folder/sent")" ] || [ "$still" -ge 15 ]; then break; fi
    sleep 0.1
  done
  stop "$receiver"
  /usr/bin/python3 - "$(basename "$0")" "$may_lose_at_end" "$folder/sent" "$folder/received" <<'PYTHON' || status=1
import json, sys
name, may_lose_at_end, *files = sys.argv[1:]
what = ('frame', 'width', 'height', 'horizon', 'traversable', 'boundary')
sent, received = ({line['frame']: [line[key] for key in what] for line in map(json.loads, open(file))} for file in files)
print(f'{name}: sent {len(sent)} frames, received {len(received)} with their metadata')
missing = [frame for frame in sent if frame not in received]
differ = [frame for frame in received if received[frame] != sent.get(frame)]
at_end = sorted(sent)[-int(may_lose_at_end):] if int(may_lose_at_end) else []
if len(sent) < 60 or differ or set(missing) - set(at_end):
    sys.exit(f'{name}: missing are the frames {missing}, others than sent are {differ}')
PYTHON
  rm -r "$folder"
  return "$status"
}
