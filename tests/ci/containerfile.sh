#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Builds Containerfile with buildah, FROM a Debian that debootstrap makes, and runs the image's entry point on a rendered scene. Where
# buildah is not or must not work, the file is followed line by line in that Debian. Needs root.
# usage: tests/ci/containerfile.sh [--by-line] [FOLDER]     FOLDER: where root and image lie (default: /var/tmp/terrainseg-container)
# Ends with "N passed, N failed".
set -uo pipefail
cd "$(dirname "$0")/../.."
. tests/ci/debian_root.sh
by_line=0
[ "${1:-}" != --by-line ] || { by_line=1; shift; }
root=${1:-/var/tmp/terrainseg-container}
log=$root.log
finish() {
  if [ "$by_line" = 1 ]; then leave_root "$root"; else clear_image; fi
  echo "$passed passed, $failed failed"
  [ "$failed" -eq 0 ] && [ "$passed" -gt 0 ]
  exit
}
must() { check "$@" || finish; }
# What the image must be able to do: a scene is rendered, and the entry point filters it.
trial() {
  echo "cd /tmp && rm -rf out && gst-launch-1.0 -q -e terrainscenesrc num-buffers=10 ! video/x-raw,format=I420,width=160,height=96 \
    ! x264enc ! mp4mux ! filesink location=drive.mp4 && $1 --output-dir out drive.mp4 && [ \$(wc -l <out/drive.jsonl) -eq 10 ]"
}

# A builder without a daemon. Where overlays cannot be mounted every layer is a copy.
driver=overlay
builder() { buildah --root "$root.image/$driver" --runroot "$root.image/$driver.run" --storage-driver "$driver" "$@"; }
base_image() {
  local container
  container=$(builder from scratch) && builder add -q "$container" "$archive" / && builder config --cmd /bin/bash "$container" &&
    builder commit -q --rm "$container" localhost/debian:12
}
built() { builder build --isolation chroot --pull=never "$@"; }
builder_works() {
  mkdir -p "$root.image/empty"
  printf 'FROM debian:12\nRUN true\n' >"$root.image/empty/Containerfile"
  base_image && built -t empty "$root.image/empty"
}
clear_image() {
  ! command -v buildah >/dev/null || { builder rm -a && builder rmi -a -f; } >/dev/null 2>&1
  rm -rf --one-file-system "$root.image"
}

archive=$(dirname "$root")/terrainseg-bookworm.tar
debian_archive bookworm "$archive" || exit 1
if [ "$by_line" = 0 ]; then
  command -v buildah >/dev/null || ./install-dependencies.sh container
  clear_image
  heartbeat "$root.log" builder_works || { clear_image; driver=vfs; heartbeat "$root.log" builder_works; } || {
    tail -n 3 "$root.log"
    echo "buildah does not work here: the file is followed line by line"
    clear_image
    by_line=1
  }
fi

if [ "$by_line" = 0 ]; then
  mkdir "$root.image/source"
  copy_source "$root.image/source" || exit 1
  must "buildah builds it" built -t terrainseg -f Containerfile "$root.image/source"
  entry=$(builder inspect --type image --format '{{index .OCIv1.Config.Entrypoint 0}}' terrainseg)
  must "a container of the image" builder from --name terrainseg-trial terrainseg
  must "the entry point runs the filter" builder run --isolation chroot terrainseg-trial -- sh -c "$(trial "$entry")"
  finish
fi

debian_root bookworm "$root" || exit 1
workdir=/ entry=
while read -r word rest; do
  case "$word" in
    "" | \#*) ;;
    FROM) must "FROM $rest is what the root is" [ "$rest" = debian:12 ] ;;
    WORKDIR) workdir=$rest; rm -rf "${root:?}$rest" "${root:?}/build"; mkdir -p "$root$rest" ;;
    COPY) must "COPY $rest" copy_source "$root${rest#. }" ;;
    RUN) must "RUN $rest" in_root "$root" sh -c "cd $workdir && $rest" ;;
    ENTRYPOINT) entry=$(tr -d '[]",' <<<"$rest") ;;
    *) must "a line that this script knows: $word" false ;;
  esac
done <Containerfile
check "the entry point runs the filter" in_root "$root" sh -c "$(trial "$entry")"
finish
