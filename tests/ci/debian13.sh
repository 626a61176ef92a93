#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# The suite on Debian 13 (GCC 14, GStreamer 1.26 with GstAnalytics, OpenCV 4.10), in a clean root that it makes itself; then terrainros2sink
# beside Fast DDS 3.
# usage: tests/ci/debian13.sh [FOLDER]     FOLDER: where the root lies (default: /var/tmp/terrainseg-debian13)
# Both end with "N passed, N failed". Where no root can be made (no root rights, no debootstrap, no Debian
# mirror) it says so and fails, like tests/ci/packages.sh.
set -uo pipefail
cd "$(dirname "$0")/../.."
. tests/ci/debian_root.sh
root=${1:-/var/tmp/terrainseg-debian13}
command -v debootstrap >/dev/null || ./install-dependencies.sh slow || exit 1
debian_root trixie "$root" || exit 1
trap 'leave_root "$root"' EXIT

mkdir -p "$root/build/terrainseg"
copy_source "$root/build/terrainseg" || exit 1
in_root "$root" sh -c 'cd /build/terrainseg && ./install-dependencies.sh test rover ros2 || exit 1; status=0
  tests/run.sh release || status=1
  tests/ci/ros2.sh || status=1
  exit $status'
