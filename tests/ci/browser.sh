#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# The rover's view in headless Chromium: installs what is missing, builds the plugin, counts what arrives in the page.
# usage: tests/ci/browser.sh [SCREENSHOT.png]     BUILD=folder (build-browser)
set -euo pipefail
cd "$(dirname "$0")/../.."
./install-dependencies.sh plugin run browser preview
build=${BUILD:-build-browser}
[ -f "$build/build.ninja" ] || meson setup "$build" -Dtests=disabled -Dtools=disabled -Dlab=disabled -Dbench=disabled >/dev/null
ninja -C "$build" gst/libgstterrainseg.so >"$build/browser-build.log" 2>&1 || { tail -n 20 "$build/browser-build.log" >&2; exit 1; }
exec /usr/bin/python3 tests/ci/browser.py "$build" "$@"
