#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Measures the accuracy on labelled sequences and writes docs/accuracy.md from docs/accuracy.in.md.
# usage: tests/evaluation/accuracy.sh [DATA]    DATA: a folder of sequences, default $TERRAINSEG_DATA
set -euo pipefail
top=$(cd "$(dirname "$0")/../.." && pwd)
data=${1:-${TERRAINSEG_DATA:-}}
if [[ -z $data || ! -d $data ]]; then
  echo "accuracy.sh: give it a folder of labelled sequences, or set TERRAINSEG_DATA" >&2
  exit 2
fi
build=${TERRAINSEG_BUILD:-$top/build}
[[ -d $build ]] || meson setup "$build" "$top" >/dev/null
ninja -C "$build" src/tools/terrainseg-eval >/dev/null
out=${TERRAINSEG_OUT:-$build/accuracy}
mkdir -p "$out"

sequences=()
for folder in "$data"/*/; do
  [[ -d $folder/frames && -d $folder/labels ]] && sequences+=("${folder%/}")
done
if [[ ${#sequences[@]} -eq 0 ]]; then
  echo "accuracy.sh: $data holds no sequence (a folder with frames/ and labels/)" >&2
  exit 1
fi
"$build/src/tools/terrainseg-eval" --baselines --ablation --caution-sweep --perturb all \
  --json "$out/accuracy.json" --markdown "$out/accuracy.md" --pictures "$out/pictures" "${sequences[@]}"
python3 "$top/tests/evaluation/fill_report.py" "$top/docs/accuracy.in.md" "$out/accuracy.md" "$top/docs/accuracy.md"

# Pictures of the off-road set only: its licence (CC BY 4.0) allows it.
mkdir -p "$top/docs/pictures"
if [[ -f $out/pictures/offroad-sheet.jpg ]]; then
  cp "$out/pictures/offroad-sheet.jpg" "$top/docs/pictures/accuracy-offroad.jpg"
fi
cp "$out/pictures/caution.png" "$top/docs/pictures/accuracy-caution.png"
echo "docs/accuracy.md is written; all pictures and figures are in $out"
