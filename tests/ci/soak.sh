#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Runs pipelines for hours in one process and fails when anything grows: resident memory, descriptors, threads, the
# 99.9th percentile of a frame; or when a frame is lost or something posts an error (docs/reliability.md).
# usage: tests/ci/soak.sh [HOURS | --self-check]     without words three minutes; BUILD=folder (build-release)
#   Every round is a row of BUILD/soak.csv. --self-check: a leak of each kind, made on purpose, has to be found.
set -uo pipefail
cd "$(dirname "$0")/../.."
build=${BUILD:-build-release}
[ -d "$build" ] || meson setup "$build" >/dev/null || exit 1
ninja -C "$build" tests/stress/soak gst/libgstterrainseg.so >"$build/soak-build.log" 2>&1 || { tail -n 30 "$build/soak-build.log"; exit 1; }
export GST_PLUGIN_PATH=$PWD/$build/gst GST_REGISTRY=$PWD/$build/registry-soak.bin

if [ "${1:-}" = --self-check ]; then
  for leak in memory descriptors threads latency; do
    if "$build/tests/stress/soak" 15 '' "$leak" >"$build/soak-$leak.log"; then
      echo "FAIL a leak of $leak is not found"
      exit 1
    fi
    grep -q '^FAIL' "$build/soak-$leak.log" || { echo "FAIL the run with a leak of $leak broke off"; exit 1; }
    echo "ok   a leak of $leak: $(grep '^FAIL' "$build/soak-$leak.log" | head -n 1)"
  done
  exit 0
fi
seconds=$(awk -v hours="${1:-0.05}" 'BEGIN { printf "%d", hours * 3600 }')
[ "$seconds" -gt 0 ] || { sed -n '5,6s/^# //p' "$0"; exit 2; }
"$build/tests/stress/soak" "$seconds" "$build/soak.csv"
