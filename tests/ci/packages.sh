#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Builds the Debian packages, runs lintian, installs them into a clean root, and runs the filter and the rover's unit there.
# usage: tests/ci/packages.sh [FOLDER]     FOLDER: where the root lies (default: /var/tmp/terrainseg-debian12)
# Ends with "N passed, N failed".
set -uo pipefail
cd "$(dirname "$0")/../.."
. tests/ci/debian_root.sh
root=${1:-/var/tmp/terrainseg-debian12}
work=$(mktemp -d)
log=$work/check.log
cleanup() { leave_root "$root"; rm -rf "$work"; }
trap cleanup EXIT

./install-dependencies.sh build slow || exit 1
. /etc/os-release
mkdir "$work/source"
copy_source "$work/source" || exit 1
check "dpkg-buildpackage" sh -c "cd '$work/source' && dpkg-buildpackage -b -us -uc"
check "lintian has no error" sh -c "lintian --fail-on error --no-tag-display-limit --allow-root '$work'/*.changes"
check "five packages and no more" sh -c "[ \"\$(ls '$work'/*.deb | grep -v dbgsym | wc -l)\" -eq 5 ]"

debian_root "$VERSION_CODENAME" "$root" || exit 1
rm -rf "$root/packages" && mkdir "$root/packages" && cp "$work"/*.deb "$root/packages/" 2>/dev/null
rm -f "$root"/packages/*dbgsym*
check "the plugin installs alone" in_root "$root" sh -c \
  'apt-get update && apt-get install -y --no-install-recommends /packages/gstreamer1.0-terrainseg_*.deb gstreamer1.0-tools'
check "gst-inspect finds every element" in_root "$root" sh -c \
  'for e in terrainseg terrainoverlay terrainextract terraincombine terrainstamp terrainscenesrc terrainmcapsink terrainros2sink; do gst-inspect-1.0 $e >/dev/null || exit 1; done'
check "the plugin names its package as its origin" in_root "$root" sh -c \
  'gst-inspect-1.0 terrainseg | grep -q "Origin URL  *Debian package terrainseg [0-9]"'
check "the filter runs" in_root "$root" sh -c \
  'gst-launch-1.0 -q terrainscenesrc num-buffers=20 ! terrainseg ! terrainextract ! application/x-ndjson ! filesink location=/tmp/t.jsonl && [ "$(wc -l </tmp/t.jsonl)" -eq 20 ]'
check "all packages install" in_root "$root" sh -c 'apt-get install -y --no-install-recommends /packages/*.deb'
check "terrainseg-process answers" in_root "$root" terrainseg-process --version
check "terrainseg-rover answers" in_root "$root" sh -c \
  'terrainseg-rover --help && [ -f /etc/terrainseg/rover.conf ] && [ -f /lib/systemd/system/terrainseg-rover.service ]'
check "terrainseg-eval answers" in_root "$root" terrainseg-eval --help
check "a program compiles against the library" in_root "$root" sh -c \
  'apt-get install -y --no-install-recommends g++ pkg-config >/dev/null &&
   printf "#include <terrainseg/segmenter.hpp>\nint main() { terrainseg::Segmenter s{terrainseg::Settings{}}; return int(s.counters().frames); }\n" >/tmp/a.cpp &&
   g++ -std=c++20 /tmp/a.cpp -o /tmp/a $(pkg-config --cflags --libs terrainseg) && /tmp/a'
check "a program compiles against the metadata header" in_root "$root" sh -c \
  'printf "#include <gst/terrainseg/terrainsegmeta.h>\nint main(void) { return 0; }\n" >/tmp/b.c &&
   cc /tmp/b.c -o /tmp/b $(pkg-config --cflags --libs gstreamer-terrainseg-1.0) && /tmp/b'
PACKAGES=$root/packages tests/ci/systemd.sh
status=$?
[ $status -eq 77 ] || check "the package's unit runs under systemd" [ $status -eq 0 ]
check "the packages leave cleanly" in_root "$root" apt-get purge -y gstreamer1.0-terrainseg libterrainseg0
echo "$passed passed, $failed failed"
[ "$failed" -eq 0 ]
