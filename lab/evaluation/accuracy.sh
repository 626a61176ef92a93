#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Measures the accuracy on labelled sequences, stills and rendered drives, and writes docs/accuracy.md from accuracy.in.md beside this
# script. The figures behind it go to lab/data/accuracy*.csv.
# usage: lab/evaluation/accuracy.sh [--all] [DATA]    DATA: a folder of sequences and sets of stills, default $TERRAINSEG_DATA
#   --all: also each stage removed, changed input, rendered places, low sun, and sets labelled by hand (about an hour)
set -euo pipefail
top=$(cd "$(dirname "$0")/../.." && pwd)
all=0
[ "${1:-}" != --all ] || { all=1; shift; }
data=${1:-${TERRAINSEG_DATA:-}}
if [[ -z $data || ! -d $data ]]; then
  echo "accuracy.sh: give it a folder of labelled sequences, or set TERRAINSEG_DATA" >&2
  exit 2
fi
build=${TERRAINSEG_BUILD:-$top/build}
[[ -d $build ]] || meson setup "$build" "$top" >/dev/null
ninja -C "$build" lab/terrainseg-eval gst/libgstterrainseg.so >/dev/null
out=${TERRAINSEG_OUT:-$build/accuracy}
mkdir -p "$out"

sequences=() stills=()
for folder in "$data"/*/; do
  [[ -d $folder/frames && -d $folder/labels ]] || continue
  [[ ${folder%/} != */india_shade ]] || continue # three of its six labels are wrong
  if python3 -c 'import json, sys; sys.exit(not json.load(open(sys.argv[1])).get("stills"))' "$folder/sequence.json"; then
    stills+=("${folder%/}")
  else
    sequences+=("${folder%/}")
  fi
done
if [[ ${#sequences[@]} -eq 0 ]]; then
  echo "accuracy.sh: $data holds no sequence (a folder with frames/ and labels/)" >&2
  exit 1
fi

# write_masks SEQUENCE: the masks and estimates that a pipeline with the default preset leaves.
write_masks() {
  local folder=$1 masks=$out/masks/${1##*/} fps bottom decoder pattern
  read -r fps bottom < <(python3 -c 'import fractions, json, sys
about = json.load(open(sys.argv[1]))
print(fractions.Fraction(about["fps"]).limit_denominator(1001), about["window_bottom"])' "$folder/sequence.json")
  [[ $fps == */* ]] || fps=$fps/1
  case $(ls "$folder/frames" | head -n 1) in
    *.png) decoder=pngdec pattern=%04d.png ;;
    *.jpg) decoder=jpegdec pattern=%04d.jpg ;;
  esac
  rm -rf "$masks"
  mkdir -p "$masks"
  gst-launch-1.0 -q multifilesrc location="$folder/frames/$pattern" caps="image/${decoder%dec},framerate=$fps" ! $decoder \
    ! videoconvert ! video/x-raw,format=I420 ! terrainseg window-bottom="$bottom" ! tee name=t \
    t. ! queue ! terrainextract ! video/x-raw,format=GRAY8 ! pngenc ! multifilesink location="$masks/%04d.png" \
    t. ! queue ! terrainextract ! application/x-ndjson ! filesink async=false location="$masks/estimates.ndjson"
}
export GST_PLUGIN_PATH=$build/gst GST_REGISTRY=$out/registry.bin
for sequence in "${sequences[@]}"; do write_masks "$sequence"; done

eval_tool=$build/lab/terrainseg-eval
more=() stages=()
[ "$all" = 0 ] || { more=(--ablation --perturb all); for stage in connected-ground light-ahead odd-spots upright; do stages+=(--engine "default,$stage=false"); done; }
"$eval_tool" --engine default --engine "masks:$out/masks" --baselines --caution-sweep "${more[@]}" \
  --csv "$out/accuracy.csv" --json "$out/accuracy.json" --markdown "$out/accuracy.md" --pictures "$out/pictures" "${sequences[@]}"
# What colour is worth: the same drives in grey.
"$eval_tool" --engine default --engine rows --engine ramp --engine mean-mask --perturb grey \
  --csv "$out/accuracy-grey.csv" --markdown "$out/grey.md" "${sequences[@]}"
# Continuous drives, with the things that stand in them.
drives=()
for kind in road trail corridor plain; do drives+=("scene:$kind:day:straight@640x360#101-106"); done
"$eval_tool" --engine default "${stages[@]}" --engine paper --csv "$out/accuracy-drives.csv" --markdown "$out/drives.md" "${drives[@]}"
pages=("$out/accuracy.md" "$out/drives.md" "$out/grey.md")
if [[ ${#stills[@]} -gt 0 ]]; then
  "$eval_tool" --engine default "${stages[@]}" --engine paper --engine rows --engine mean-mask \
    --csv "$out/accuracy-stills.csv" --json "$out/stills.json" --markdown "$out/stills.md" --pictures "$out/pictures" "${stills[@]}"
  pages+=("$out/stills.md")
fi
if [ "$all" = 1 ]; then
  rendered=() lights=()
  for kind in road trail corridor plain; do
    for light in day dusk; do rendered+=("scene:$kind:$light"); done
    for light in sun day+wet; do lights+=("scene:$kind:$light"); done
  done
  "$eval_tool" --baselines --csv "$out/accuracy-rendered.csv" --markdown "$out/rendered.md" "${rendered[@]}"
  "$eval_tool" --engine default --engine rows --engine ramp --csv "$out/accuracy-light.csv" --markdown "$out/light.md" "${lights[@]}"
  # Clips and photographs without labels, with outlines drawn by hand.
  rm -rf "$out/hand"
  /usr/bin/python3 "$top/lab/evaluation/hand_labels.py" "$data" "$out/hand"
  "$eval_tool" --engine default --engine paper --engine rows --engine mean-mask \
    --csv "$out/accuracy-hand.csv" --markdown "$out/hand.md" --pictures "$out/pictures" "$out"/hand/*/
fi
sed -i "s,masks:$out/masks,default through a pipeline," "$out/accuracy.md" "$out/accuracy.csv"
python3 "$top/lab/evaluation/fill_report.py" "$top/lab/evaluation/accuracy.in.md" "$top/docs/accuracy.md" "${pages[@]}"
mkdir -p "$top/lab/data"
cp "$out"/accuracy*.csv "$top/lab/data/"
/usr/bin/python3 "$top/lab/evaluation/draw_charts.py" "$out/pictures"

echo "docs/accuracy.md is written; all pictures and figures are in $out"
