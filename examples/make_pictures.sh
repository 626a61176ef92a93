#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Makes the pictures and clips of README.md and docs/ from the project's own scenes, with the filter as it is now.
# usage: examples/make_pictures.sh [FOLDER]
# leaves in FOLDER (default: docs/images) the scenes as they are and one frame in every overlay style as JPEG, and what the
# commands of docs/gallery.md make: JPEG pictures and WebP clips. MAX_FRAMES=n drives each scene for n frames at most: a trial.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
case ${1:-} in
  -h | --help) sed -n '3,6s/^# //p' "$0"; exit ;;
  -*) sed -n '3,6s/^# //p' "$0" >&2; exit 2 ;;
esac
folder=${1:-$here/../docs/images}
. "$here/common.sh"
mkdir -p "$folder"

made() { # made FILE: it is there, and this run has made it
  [ "$folder/$1" -nt "$started" ] || fail "$1 was not made"
  echo "$1 $(stat -c %s "$folder/$1") bytes"
}
started=$(mktemp)
trap 'rm -f "$started"' EXIT

# picture NAME FRAMES "SCENE PROPERTIES" [ELEMENTS]: the last of FRAMES frames; the file is written anew with every frame.
picture() {
  local name=$1 frames=$2 scene=$3 elements=${4:-identity}
  [ "$frames" -le "${MAX_FRAMES:-$frames}" ] || frames=$MAX_FRAMES
  (pipeline "terrainscenesrc num-buffers=$frames $scene ! video/x-raw,format=I420,width=640,height=360 ! $elements \
    ! videoconvert ! jpegenc quality=88 ! multifilesink location=$(quoted "$folder/$name.jpg")")
  made "$name.jpg"
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

# One frame in every style.
for style in tint contour mask models; do
  picture "style_$style" 60 "scene=road seed=7 motion=bumpy" "terrainseg ! terrainoverlay overlay-style=$style"
done

gallery
