#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# The rover's page in headless Chromium: installs what is missing, builds the plugins, looks, draws, records and downloads.
# usage: tests/ci/browser.sh [FOLDER]     FOLDER/: for screenshots     BUILD=folder (build-browser)
set -euo pipefail
cd "$(dirname "$0")/../.."
./install-dependencies.sh plugin process run browser
build=${BUILD:-build-browser}
[ -f "$build/build.ninja" ] || meson setup "$build" -Dtests=disabled -Dtools=disabled -Dlab=disabled -Dbench=disabled >/dev/null
ninja -C "$build" gst/libgstterrainseg.so gst/libgstterrainmcap.so >"$build/browser-build.log" 2>&1 || { tail -n 20 "$build/browser-build.log" >&2; exit 1; }
exec /usr/bin/python3 tests/ci/browser.py "$build" ${1:+"$(realpath -m "$1")/"}
