#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# After each documented way to install, the next documented steps: in a clean root of this machine's Debian, one way after the other.
# usage: tests/ci/installs.sh [WAY...]     WAY: quickstart | devenv | install (default: all; tests/ci/packages.sh walks through the packages)
# ROOT is the folder of the root (default: /var/tmp/terrainseg-debian12). Ends with "N passed, N failed".
set -uo pipefail
cd "$(dirname "$0")/../.."
. tests/ci/debian_root.sh
root=${ROOT:-/var/tmp/terrainseg-debian12}
ways=("$@")
[ $# -gt 0 ] || ways=(quickstart devenv install)
command -v debootstrap >/dev/null || ./install-dependencies.sh slow || exit 1
. /etc/os-release
debian_root "$VERSION_CODENAME" "$root" || exit 1
log=$(mktemp)
trap 'rm -f "$log"; leave_root "$root"' EXIT
source=/build/installs
mkdir -p "$root$source"
copy_source "$root$source" || exit 1

# What the pages say comes next: name | command. All end without an error, from the source tree; $out is an empty folder.
steps=(
  "the filter is there|gst-inspect-1.0 terrainseg"
  "a pipeline of README|gst-launch-1.0 -q terrainscenesrc num-buffers=20 ! video/x-raw,width=320,height=180 ! terrainseg overlay=true ! fakesink"
  "README over ssh|cd \$out && gst-launch-1.0 -q -e terrainscenesrc num-buffers=30 ! terrainseg overlay=true ! videoconvert ! video/x-raw,format=I420 ! x264enc ! mp4mux ! filesink location=drive.mp4 && test -s drive.mp4"
  "files|terrainseg-process \$out/drive.mp4 --output-dir \$out/files && test -s \$out/files/drive.annotated.mp4"
  "recordings from files|terrainseg-process \$out/drive.mp4 --output-dir \$out/recorded --outputs mcap,json && test -s \$out/recorded/drive.bag/terrain.mcap"
  "a recording from a pipeline|gst-launch-1.0 -q -e terrainscenesrc num-buffers=20 ! terrainseg ! terrainmcapsink location=\$out/drive.mcap && test -s \$out/drive.mcap"
  "calibration|terrainseg-calibrate --help"
  "the example in C|cc examples/c/read_mask.c -o \$out/read_mask \$(pkg-config --cflags --libs gstreamer-terrainseg-1.0 gstreamer-app-1.0) && \$out/read_mask"
  "the example in C++|c++ -std=c++20 examples/cpp/core_only.cpp -o \$out/core_only \$(pkg-config --cflags --libs terrainseg) && head -c 1728000 /dev/zero | \$out/core_only 640x360 >\$out/masks.pgm"
  "the example in Python|/usr/bin/python3 examples/python/mask_to_numpy.py"
  "an example script|env SOURCE='terrainscenesrc num-buffers=20' VIEW=fakesink examples/camera.sh"
  "metres to an autopilot|env SCENE='terrainscenesrc num-buffers=20 ! video/x-raw,width=320,height=180' examples/ardupilot.sh --scene"
  "the rover's page|{ timeout -s INT 8 terrainseg-rover --source scene --port 0 --folder \$out/state >\$out/address || [ \$? -eq 124 ]; } && grep token= \$out/address"
  "tuning without a display|./install-dependencies.sh tune && examples/tune.sh \$out/drive.mp4 --picture \$out/look.png && test -s \$out/look.png"
)
# What the quickstart does not build, as its pages say.
whole_steps=(
  "topics for ROS 2|gst-launch-1.0 -q terrainscenesrc num-buffers=20 ! terrainseg ! terrainros2sink"
)
here() { in_root "$root" sh -c "cd $source && $1"; }
# walk WAY PREFIX STEP...: each step, by a shell that PREFIX starts.
walk() {
  local way=$1 prefix=$2 step
  shift 2
  here 'rm -rf /tmp/out && mkdir /tmp/out'
  for step in "$@"; do
    printf 'cd %s; out=/tmp/out; %s\n' "$source" "${step#*|}" >"$root/tmp/step.sh"
    check "$way: ${step%%|*}" here "$prefix sh -e /tmp/step.sh"
  done
}

for way in "${ways[@]}"; do
  case $way in
    quickstart)
      check "quickstart" here examples/quickstart.sh
      walk quickstart 'meson devenv -w . -C build-quickstart' "${steps[@]}" ;;
    devenv)
      check "build" here './install-dependencies.sh build run && { [ -d build ] || meson setup build -Dtests=disabled; } && ninja -C build'
      walk devenv 'meson devenv -w . -C build' "${steps[@]}" "${whole_steps[@]}" ;;
    install)
      check "meson install" here './install-dependencies.sh build run && { [ -d build ] || meson setup build -Dtests=disabled; } && ninja -C build && meson install -C build'
      # No build of the tree may answer for what is installed.
      here 'mkdir -p /build/aside && mv build /build/aside/ && if [ -d build-quickstart ]; then mv build-quickstart /build/aside/; fi'
      walk install '' "${steps[@]}" "${whole_steps[@]}"
      here 'mv /build/aside/* .'
      check "ninja uninstall" here 'ninja -C build uninstall && ! gst-inspect-1.0 terrainseg >/dev/null 2>&1 && ! command -v terrainseg-process' ;;
    *) echo "installs.sh: unknown way '$way': quickstart, devenv, install" >&2; exit 2 ;;
  esac
done
echo "$passed passed, $failed failed"
[ "$failed" -eq 0 ]
