#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Makes the pictures of README.md and docs/ from the project's own scenes, with the filter as it is now.
# usage: examples/make_pictures.sh [FOLDER]
# leaves JPEG files in FOLDER (default: docs/images): the scenes as they are, and the filter's view of them in every
# overlay style. Takes the plugin from GST_PLUGIN_PATH, from build/, or where it is installed. MAX_FRAMES=n drives each
# scene for n frames at most: a quick trial.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
case ${1:-} in
  -h | --help) sed -n '3,7s/^# //p' "$0"; exit ;;
  -*) sed -n '3,7s/^# //p' "$0" >&2; exit 2 ;;
esac
folder=${1:-$here/../docs/images}
if [ -z "${GST_PLUGIN_PATH:-}" ] && [ -e "$here/../build/gst/libgstterrainseg.so" ]; then
  export GST_PLUGIN_PATH=$here/../build/gst
fi
gst-inspect-1.0 terrainscenesrc >/dev/null 2>&1 ||
  { echo "make_pictures.sh: GStreamer does not find the plugin: build it, or set GST_PLUGIN_PATH" >&2; exit 1; }
mkdir -p "$folder"

# picture NAME FRAMES "SCENE PROPERTIES" [ELEMENTS]: the last of FRAMES frames; the file is written anew with every frame.
picture() {
  local name=$1 frames=$2 scene=$3 elements=${4:-identity}
  [ "$frames" -le "${MAX_FRAMES:-$frames}" ] || frames=$MAX_FRAMES
  eval "gst-launch-1.0 -q terrainscenesrc num-buffers=$frames $scene ! video/x-raw,format=I420,width=640,height=360 ! $elements \
    ! videoconvert ! jpegenc quality=88 ! multifilesink location=\"\$folder/$name.jpg\""
  [ -s "$folder/$name.jpg" ] || { echo "make_pictures.sh: $name.jpg was not made" >&2; exit 1; }
  echo "$name.jpg $(stat -c %s "$folder/$name.jpg") bytes"
}

# The places as they are.
picture scene_road 1 "scene=road seed=3"
picture scene_trail 40 "scene=trail seed=5"
picture scene_corridor 40 "scene=corridor seed=5"
picture scene_plain 1 "scene=plain seed=5"
picture scene_dusk 40 "scene=road seed=4 light=dusk"
picture scene_bumpy 26 "scene=trail seed=4 motion=bumpy"

# What the filter makes of them, one style each, after 45 frames of driving.
picture road_tint 45 "scene=road seed=1" "terrainseg ! terrainoverlay"
picture trail_contour 45 "scene=trail seed=5" "terrainseg ! terrainoverlay overlay-style=contour overlay-alpha=0.5"
picture corridor_models 45 "scene=corridor seed=5" "terrainseg ! terrainoverlay overlay-style=models"
picture plain_tint 45 "scene=plain seed=1" "terrainseg ! terrainoverlay overlay-color=0xff2080ff"
picture road_dusk_tint 45 "scene=road seed=4 light=dusk" "terrainseg ! terrainoverlay"

# One frame in every style.
for style in tint contour mask models; do
  picture "style_$style" 60 "scene=road seed=7 motion=bumpy" "terrainseg ! terrainoverlay overlay-style=$style"
done
