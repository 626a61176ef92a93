#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Makes the pictures and clips of README.md and docs/ from the project's own scenes with the current filter.
# usage: examples/make_pictures.sh [FOLDER]
# Writes into FOLDER (default: docs/images): the scenes, one frame in every overlay style and a frame with metres as JPEG,
# and the results of the commands of docs/gallery.md as JPEG pictures and WebP clips.
# MAX_FRAMES=n limits each scene to n frames, for a trial.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
case ${1:-} in
  -h | --help) sed -n '3,7s/^# //p' "$0"; exit ;;
  -*) sed -n '3,7s/^# //p' "$0" >&2; exit 2 ;;
esac
folder=${1:-$here/../docs/images}
. "$here/common.sh"
mkdir -p "$folder"

made() { # made FILE: it is there, and this run has made it
  [ "$folder/$1" -nt "$started" ] || fail "$1 was not made"
  echo "$1 $(stat -c %s "$folder/$1") bytes"
}
work=$(mktemp -d)
started=$work/started
touch "$started"
trap 'rm -rf "$work"' EXIT

# tool NAME: the program of the build that the plugin is from, else the one that is installed.
tool() {
  local build=${GST_PLUGIN_PATH:-}
  build=${build%%:*}/..
  if [ -x "$build/lab/$1" ]; then echo "$build/lab/$1"; elif [ -x "$build/src/tools/$1" ]; then echo "$build/src/tools/$1"; else command -v "$1" || fail "there is no $1: build it, or install it"; fi
}

# picture NAME FRAMES "SCENE PROPERTIES" [ELEMENTS]: the last of FRAMES frames; each frame overwrites the file.
picture() {
  local name=$1 frames=$2 scene=$3 elements=${4:-identity}
  [ "$frames" -le "${MAX_FRAMES:-$frames}" ] || frames=$MAX_FRAMES
  (pipeline "terrainscenesrc num-buffers=$frames $scene ! video/x-raw,format=I420,width=640,height=360 ! $elements \
    ! videoconvert ! jpegenc quality=88 ! multifilesink location=$(quoted "$folder/$name.jpg")")
  made "$name.jpg"
}

# camera_info WIDTH HEIGHT: the lens that terrainscenesrc has at that size, as terrainseg and terrainseg-calibrate read it.
camera_info() {
  awk -v w="$1" -v h="$2" 'BEGIN {
    printf "image_width: %d\nimage_height: %d\n", w, h
    printf "camera_matrix: {rows: 3, cols: 3, data: [%g, 0, %g, 0, %g, %g, 0, 0, 1]}\n", 0.82 * w, (w - 1) / 2, 0.82 * w, (h - 1) / 2
  }' >"$work/$1.yaml"
}

# metres: a calibrated camera's picture with the ground's metres on it, and the filter's metres with their map.
metres() {
  camera_info 960 540
  (pipeline "terrainscenesrc num-buffers=1 scene=road seed=1 ! video/x-raw,format=I420,width=960,height=540 ! videoconvert ! pngenc \
    ! filesink location=$(quoted "$work/frame.png")")
  "$(tool terrainseg-calibrate)" mount --camera-info "$work/960.yaml" --point 339,467.5,4.5 --point 620,467.5,4.5 --point 339,351.6,9 \
    --point 586,304.8,15 --frame "$work/frame.png" --picture "$work/grid.png" --out "$work/mount.yaml" >/dev/null
  (pipeline "filesrc location=$(quoted "$work/grid.png") ! pngdec ! videoconvert ! video/x-raw,format=I420 ! jpegenc quality=88 \
    ! filesink location=$(quoted "$folder/calibration_grid.jpg")")
  made calibration_grid.jpg
  camera_info 640 360
  picture metres_map 60 "scene=corridor seed=5" \
    "terrainseg camera-info=$(quoted "$work/640.yaml") mount=height=0.65,pitch=0.055 ! terrainoverlay overlay-style=map"
}

# gallery: every command of docs/gallery.md as it is printed there; the last word of each is the file that it makes.
gallery() {
  local command="" line inside=0
  while IFS= read -r line; do
    if [ "$line" = '```sh' ]; then
      inside=1 command=""
    elif [ "$line" = '```' ]; then
      inside=0
      [ -z "${MAX_FRAMES:-}" ] || command=$(sed -E "s/num-buffers=[0-9]+/num-buffers=$MAX_FRAMES/" <<<"$command")
      (cd "$folder" && bash -euo pipefail -c "$command")
      made "$(grep -oE '[^ =]+$' <<<"$command" | tail -n 1)"
    elif [ "$inside" = 1 ]; then
      command+=$line$'\n'
    fi
  done <"$here/../docs/gallery.md"
}

# The places as they are.
picture scene_road 1 "scene=road seed=3"
picture scene_trail 40 "scene=trail seed=5"
picture scene_corridor 40 "scene=corridor seed=5"
picture scene_plain 1 "scene=plain seed=5"
picture scene_dusk 40 "scene=road seed=4 light=dusk"
picture scene_bumpy 26 "scene=trail seed=4 motion=bumpy"
picture scene_sun 1 "scene=trail seed=8 light=sun"
picture scene_wet 1 "scene=road seed=6 wet=true"

# One frame in every style.
for style in tint contour mask models; do
  picture "style_$style" 60 "scene=road seed=7 motion=bumpy" "terrainseg ! terrainoverlay overlay-style=$style"
done

metres
gallery
