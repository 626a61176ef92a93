#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# All tables and figures of the paper's experiments, in one go.
# usage: lab/evaluation/reproduce.sh [DATA]
# DATA is a folder of labelled sequences; without it TERRAINSEG_DATA is taken, and without that scenes are rendered.
# OUT names the folder for the results (default: paper), LIMIT the frames per sequence (default: all).
set -euo pipefail
case "${1:-}" in
  -h | --help) sed -n '3,/^[^#]/s/^# \{0,1\}//p' "$0"; exit ;;
  -*) echo "reproduce.sh: $1: no such option; --help shows how" >&2; exit 2 ;;
esac
top=$(cd "$(dirname "$0")/../.." && pwd)
data=${1:-${TERRAINSEG_DATA:-}}
out=${OUT:-paper}
if [ -n "$data" ] && [ ! -d "$data" ]; then
  echo "reproduce.sh: $data: no such folder; leave it out to use rendered scenes" >&2
  exit 2
fi
[ -n "$data" ] || echo "reproduce.sh: no data folder: the scenes are rendered, and section 4.2 is left out because they have no depth"

build=${BUILD:-$top/build}
if [ -z "${BUILD:-}" ]; then
  command -v meson >/dev/null || "$top/install-dependencies.sh" test
  [ -d "$build" ] || meson setup "$build" "$top" >/dev/null
  ninja -C "$build" lab/terrainseg-eval >/dev/null
fi
eval_tool=$build/lab/terrainseg-eval

options=(--out "$out")
[ -z "$data" ] || options+=(--data "$data")
[ -z "${LIMIT:-}" ] || options+=(--limit "$LIMIT")
start=$SECONDS
"$eval_tool" figures "${options[@]}"
"$eval_tool" paper "${options[@]}" >/dev/null
/usr/bin/python3 "$top/lab/evaluation/draw_charts.py" "$out"
{
  echo
  echo "## Where"
  echo
  echo "- processor: $(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -n 1), $(nproc) threads, load $(cut -d' ' -f1 /proc/loadavg) at the end"
  echo "- compiler: $(c++ --version | head -n 1)"
  echo "- commit: $(git -C "$top" describe --always --dirty 2>/dev/null || echo unknown)"
  echo "- took $((SECONDS - start)) s"
} >>"$out/paper.md"
echo "reproduce.sh: $out/paper.md and the pictures beside it, in $((SECONDS - start)) s"
