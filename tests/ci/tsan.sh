#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# ThreadSanitizer: the unit and element tests that use several threads, then tests/stress/stress.cpp for a minute. A data race fails.
# What GLib's own locks order is told by tests/tsan/glib_order.cpp; what is left of theirs stands in tests/tsan/suppressions.txt.
# usage: tests/ci/tsan.sh [SECONDS [SEED]]     60 s; BUILD=folder (build-tsan)
set -uo pipefail
cd "$(dirname "$0")/../.." || exit
build=${BUILD:-build-tsan}
seconds=${1:-60}
seed=${2:-$RANDOM}
element=(terraincombine terrainseg_events terrainseg_settings)
[ -d "$build" ] || meson setup "$build" --buildtype=debugoptimized -Db_sanitize=thread -Db_lundef=false -Dtools=disabled -Dlab=disabled \
  -Dbench=disabled >"$build.log" 2>&1 || { tail -n 20 "$build.log"; exit 1; }
targets=(gst/libgstterrainseg.so tests/stress/stress tests/tsan/libglib_order.so tests/tsan/threads_test tests/tsan/race)
for name in "${element[@]}"; do
  case $name in terrainseg*|terrainscenesrc) targets+=("tests/element/${name}_element_test") ;; *) targets+=("tests/element/${name}_test") ;; esac
done
ninja -C "$build" "${targets[@]}" >"$build/build.log" 2>&1 || { grep -A6 -E 'error|FAILED' "$build/build.log" | head -n 40; exit 1; }

top=$PWD/$build
export GST_PLUGIN_PATH=$top/gst GST_REGISTRY=$top/registry-tsan.bin GST_REGISTRY_FORK=no GST_DEBUG_NO_COLOR=1 TERRAINSEG_SANITIZED=1
export TERRAINSEG_PLUGIN=$top/gst/libgstterrainseg.so TERRAINSEG_SOURCE=$PWD TERRAINSEG_PATIENCE=10
# GLib before 2.76 hands what one thread gave back to another without a call that could be seen; malloc is seen.
export G_SLICE=always-malloc
export TSAN_OPTIONS="halt_on_error=0 exitcode=66 second_deadlock_stack=1 history_size=4 ignore_noninstrumented_modules=1 suppressions=$PWD/tests/tsan/suppressions.txt"

preloaded() { timeout 480 env LD_PRELOAD="$top/tests/tsan/libglib_order.so" "$@"; }
failed=0
# run NAME COMMAND...: a race gives the program's exit status 66.
run() {
  local name=$1
  shift
  if preloaded "$@" >"$build/tsan-$name.log" 2>&1; then
    echo "ok $name"
  else
    echo "FAIL $name (status $?, $(grep -c 'WARNING: ThreadSanitizer' "$build/tsan-$name.log") reports)"
    grep -A1 'SUMMARY: ThreadSanitizer' "$build/tsan-$name.log" | sort | uniq -c | sort -rn | head -n 20
    grep -E '^(\[  FAILED|FAIL)' "$build/tsan-$name.log" | head -n 10
    failed=1
  fi
}
# The check itself: two threads under two locks are found, under one lock they are none.
if preloaded "$build/tests/tsan/race" >"$build/tsan-race.log" 2>&1 || ! preloaded "$build/tests/tsan/race" one-lock >>"$build/tsan-race.log" 2>&1; then
  echo "FAIL a race on purpose is not told from none: see $build/tsan-race.log"
  exit 1
fi
run threads "$build/tests/tsan/threads_test" --gtest_filter=-Segmenter.PaddingAndStridesDoNotMatter:Segmenter.FormatsOfOneLayoutAgree
for target in "${targets[@]}"; do
  case $target in tests/element/*) run "$(basename "$target")" "$build/$target" ;; esac
done
run stress "$build/tests/stress/stress" "$seconds" "$seed"
tail -n 1 "$build/tsan-stress.log"
exit "$failed"
