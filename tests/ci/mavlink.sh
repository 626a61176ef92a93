#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# A minute of MAVLink, decoded by another implementation (npm's node-mavlink) without loss. Slow: fetches a package.
# usage: tests/ci/mavlink.sh [BUILD_FOLDER]
#   BUILD_FOLDER  a build that is there (default: build-release, else build)
# Without npm, or without a way to the package, it says so and ends with 77: skipped.
set -euo pipefail
cd "$(dirname "$0")/../.."
build=${1:-build-release}
[ -d "$build" ] || build=build
[ -e "$build/gst/libgstterrainseg.so" ] || { echo "mavlink.sh: $build holds no plugin: ninja -C $build gst/libgstterrainseg.so" >&2; exit 1; }
command -v npm >/dev/null && command -v node >/dev/null || { echo "mavlink.sh: skipped: npm and node are not there"; exit 77; }
build=$(cd "$build" && pwd)
checker=$PWD/tests/ci/mavlink_check.mjs
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
export GST_PLUGIN_PATH=$build/gst GST_REGISTRY=$folder/registry.bin
cd "$folder"
npm install --silent --no-audit --no-fund --ignore-scripts node-mavlink@2.3.0 >npm.log 2>&1 || {
  echo "mavlink.sh: skipped: npm cannot fetch node-mavlink: $(tail -n 1 npm.log)"
  exit 77
}
# The calibration of the scene `road`: 0.82 widths of focal length, 1.35 m, a horizon at 43 % of the height.
cat >camera.yaml <<'YAML'
image_width: 320
image_height: 180
camera_matrix: {rows: 3, cols: 3, data: [262.4, 0, 159.5, 0, 262.4, 89.5, 0, 0, 1]}
YAML
for layout in portable fine; do
  gst-launch-1.0 -q terrainscenesrc num-buffers=1800 ! video/x-raw,width=320,height=180,framerate=30/1 ! terrainseg camera-info=camera.yaml mount=height=1.35,pitch=2.75deg \
    ! terrainextract mavlink-layout=$layout system-id=7 ! application/x-mavlink ! filesink location=$layout.mav
  cp "$checker" check.mjs
  node check.mjs $layout.mav $layout 60
done
