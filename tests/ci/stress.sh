#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# What applications do to the elements, in random order (tests/stress/stress.cpp): once with criticals as errors, and
# once under the leaks tracer, which must find no object of ours left.
# usage: tests/ci/stress.sh [SECONDS [SEED]]     60 s each; BUILD=folder (build-release)
set -uo pipefail
cd "$(dirname "$0")/../.."
build=${BUILD:-build-release}
seconds=${1:-60}
seed=${2:-$RANDOM}
[ -d "$build" ] || meson setup "$build" >/dev/null || exit 1
ninja -C "$build" tests/stress/stress gst/libgstterrainseg.so >"$build/stress-build.log" 2>&1 || { tail -n 30 "$build/stress-build.log"; exit 1; }
export GST_PLUGIN_PATH=$PWD/$build/gst GST_REGISTRY=$PWD/$build/registry-stress.bin GST_DEBUG_NO_COLOR=1

"$build/tests/stress/stress" "$seconds" "$seed" >"$build/stress.log" 2>&1 || { tail -n 20 "$build/stress.log"; exit 1; }
tail -n 1 "$build/stress.log"
GST_TRACERS=leaks GST_DEBUG=GST_TRACER:7 "$build/tests/stress/stress" "$seconds" "$seed" >"$build/stress-leaks.log" 2>&1 ||
  { grep -v GST_TRACER "$build/stress-leaks.log" | tail -n 20; exit 1; }
# The line that explains the format is no object.
left=$(grep 'object-alive, type-name=(string)' "$build/stress-leaks.log" | grep -v 'new format string' | sed 's/.*type-name=(string)\([^,]*\),.*/\1/' | sort | uniq -c)
[ -z "$left" ] || { echo "FAIL objects are left:"; echo "$left"; exit 1; }
grep '^ok' "$build/stress-leaks.log" | sed 's/$/; no object is left/'
