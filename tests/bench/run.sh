#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Builds optimised, measures, and writes docs/data/speed.csv and docs/data/speed.txt: processor, compiler, commit, and every
# figure beside its floor, taken in the same loop.
# usage: tests/bench/run.sh [--quick] [--realtime] [--out FOLDER] [SECTION...]
#   sections: kernels goal formats stages paper streams element outlets files     without one: all
#   --realtime: before all other programs of the machine, as far as the user may (all but whole pipelines)
# "files" times decode + filter + encode of a HD file (of the rendered scene, or of $TERRAINSEG_VIDEO).
set -euo pipefail
cd "$(dirname "$0")/../.."
out=docs/data
quick=()
first=()
sections=()
while [ $# -gt 0 ]; do
  case "$1" in
    --quick) quick=(--quick) ;;
    --realtime) first=(chrt -f 10) ;;
    --out) out=$2; shift ;;
    kernels | goal | formats | stages | paper | streams | element | outlets | files) sections+=("$1") ;;
    *) sed -n '3,9s/^# //p' "$0" >&2; exit 2 ;;
  esac
  shift
done
[ ${#sections[@]} -gt 0 ] || sections=(kernels goal formats stages paper streams element outlets files)
wants() { [[ " ${sections[*]} " == *" $1 "* ]]; }

./install-dependencies.sh test
if wants element && ! gst-inspect-1.0 segmentation >/dev/null 2>&1; then
  root=()
  [ "$(id -u)" -eq 0 ] || root=(sudo)
  "${root[@]}" apt-get install -y --no-install-recommends gstreamer1.0-opencv >/dev/null ||
    echo "gstreamer1.0-opencv cannot be installed: no comparison with its segmentation element" >&2
fi

build=build-bench
[ -d "$build" ] || meson setup "$build" --buildtype=release -Dbench=enabled >/dev/null
ninja -C "$build" >"$build.log" 2>&1 || { tail -n 30 "$build.log"; exit 1; }
if [ ${#first[@]} -gt 0 ] && ! "${first[@]}" true 2>/dev/null; then
  echo "no right to real-time priority (chrt): measured as an ordinary program" >&2
  first=()
fi
export GST_PLUGIN_PATH=$PWD/$build/gst GST_REGISTRY=$PWD/$build/bench-registry.bin

mkdir -p "$out"
rm -f "$out"/part-*.json
{
  core=()
  for section in kernels goal formats stages paper streams; do
    if wants "$section"; then core+=("$section"); fi
  done
  if [ ${#core[@]} -gt 0 ]; then
    "${first[@]}" "$build/tests/bench/terrainseg-bench" "${quick[@]}" --json "$out/part-core.json" "${core[@]}"
  fi
  if wants element; then
    "${first[@]}" "$build/tests/bench/terrainseg-bench-elements" "${quick[@]}" --json "$out/part-element.json"
  fi
  if wants outlets; then
    tests/bench/outlets.py "$build/tests/bench/outlet_elements_bench" "$out/part-outlets.json" "${quick[@]}"
  fi
  if wants files; then
    tests/bench/files.sh "${quick[@]}" "$out/part-files.json"
  fi
} | tee "$out/speed.txt"
/usr/bin/python3 tests/bench/merge.py "$build" "$out"
