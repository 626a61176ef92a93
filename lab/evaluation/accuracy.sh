#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Measures the accuracy on labelled sequences, stills and rendered places; writes docs/accuracy.md from docs/accuracy.in.md and the
# figures behind it to docs/data/accuracy*.csv.
# usage: lab/evaluation/accuracy.sh [DATA]    DATA: a folder of sequences and sets of stills, default $TERRAINSEG_DATA
set -euo pipefail
top=$(cd "$(dirname "$0")/../.." && pwd)
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

"$build/lab/terrainseg-eval" --engine default --engine "masks:$out/masks" --baselines --ablation --caution-sweep --perturb all \
  --csv "$out/accuracy.csv" --json "$out/accuracy.json" --markdown "$out/accuracy.md" --pictures "$out/pictures" "${sequences[@]}"
# What colour is worth: the same drives in grey.
"$build/lab/terrainseg-eval" --engine default --engine rows --engine ramp --engine mean-mask --perturb grey \
  --csv "$out/accuracy-grey.csv" --markdown "$out/grey.md" "${sequences[@]}"
rendered=()
for kind in road trail corridor plain; do
  for light in day dusk; do rendered+=("scene:$kind:$light"); done
done
"$build/lab/terrainseg-eval" --baselines --csv "$out/accuracy-rendered.csv" --markdown "$out/rendered.md" "${rendered[@]}"
# Light edges: what a low sun and puddles do.
lights=()
for kind in road trail corridor plain; do
  for light in sun day+wet; do lights+=("scene:$kind:$light"); done
done
"$build/lab/terrainseg-eval" --engine default --engine rows --engine ramp --csv "$out/accuracy-light.csv" --markdown "$out/light.md" "${lights[@]}"
# What the stages that came for unknown places are worth there.
late=(--engine default,motion=off)
for stage in connected-ground light-ahead own-shadow odd-spots; do late+=(--engine "default,$stage=false"); done
# The same places as continuous drives, with the things that stand in them.
drives=()
for kind in road trail corridor plain; do drives+=("scene:$kind:day:straight@640x360#101-106"); done
"$build/lab/terrainseg-eval" --engine default "${late[@]}" --engine paper --csv "$out/accuracy-drives.csv" --markdown "$out/drives.md" "${drives[@]}"
pages=("$out/accuracy.md" "$out/rendered.md" "$out/light.md" "$out/drives.md" "$out/grey.md")
if [[ ${#stills[@]} -gt 0 ]]; then
  "$build/lab/terrainseg-eval" --engine default "${late[@]}" --engine paper --engine rows --engine mean-mask \
    --csv "$out/accuracy-stills.csv" --json "$out/stills.json" --markdown "$out/stills.md" --pictures "$out/pictures" "${stills[@]}"
  pages+=("$out/stills.md")
fi
# Clips and photographs without labels, with outlines drawn by hand.
rm -rf "$out/hand"
/usr/bin/python3 "$top/lab/evaluation/hand_labels.py" "$data" "$out/hand"
"$build/lab/terrainseg-eval" --engine default --engine paper --engine rows --engine mean-mask \
  --csv "$out/accuracy-hand.csv" --markdown "$out/hand.md" --pictures "$out/pictures" "$out"/hand/*/
pages+=("$out/hand.md")
sed -i "s,masks:$out/masks,default through a pipeline," "$out/accuracy.md" "$out/accuracy.csv"
python3 "$top/lab/evaluation/fill_report.py" "$top/docs/accuracy.in.md" "$top/docs/accuracy.md" "${pages[@]}"
mkdir -p "$top/docs/data"
cp "$out"/accuracy*.csv "$top/docs/data/"

# Pictures of the off-road set only: its licence (CC BY 4.0) allows it.
mkdir -p "$top/docs/pictures"
if [[ -f $out/pictures/offroad-sheet.jpg ]]; then
  cp "$out/pictures/offroad-sheet.jpg" "$top/docs/pictures/accuracy-offroad.jpg"
fi
cp "$out/pictures/caution.png" "$top/docs/pictures/accuracy-caution.png"
echo "docs/accuracy.md is written; all pictures and figures are in $out"
