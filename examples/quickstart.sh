#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Installs missing packages, builds the filter and runs it once, on VIDEO or on a rendered scene.
# usage: examples/quickstart.sh [VIDEO] [PROPERTY=VALUE...]      a property of terrainseg, such as window-bottom=80
# Writes quickstart/annotated.mp4 (H.264), quickstart/masks.mkv (FFV1, GRAY8), quickstart/terrain.jsonl and
# quickstart/preview.png, a contact sheet: annotated frames above, their masks below. Earlier results move to
# quickstart/earlier-N.
# If VIDEO is damaged, the frames that could be decoded are kept as quickstart/partial.*, and the exit status is 1.
# (QUICKSTART_BUILD: use this existing build unchanged; QUICKSTART_RESULTS: another folder for the results.)
set -euo pipefail
top=$(cd "$(dirname "$0")/.." && pwd)
. "$top/examples/heartbeat.sh"
fail() { echo "quickstart: $*" >&2; exit 1; }
usage() { sed -n '3,9s/^# //p' "$0"; exit "$1"; }

video="" settings=()
for argument in "$@"; do
  case "$argument" in
    --help | -h) usage 0 ;;
    -*) usage 2 ;;
  esac
  if [ -e "$argument" ]; then
    [ -z "$video" ] || usage 2
    [ -f "$argument" ] && [ -r "$argument" ] || fail "$argument is not a file that can be read"
    video=$(realpath "$argument")
  elif [[ $argument =~ ^[a-z][a-z0-9-]*=. ]]; then
    settings+=(--set "$argument")
  else
    fail "$argument: there is no such file, and it is not PROPERTY=VALUE"
  fi
done

results=$(realpath -m "${QUICKSTART_RESULTS:-$top/quickstart}")
cd "$top"
begin=$SECONDS
./install-dependencies.sh plugin process run preview
installed=$((SECONDS - begin))

# Only what the next steps take is compiled: plugins, library, terrainseg-process and terrainseg-calibrate.
build=${QUICKSTART_BUILD:-$top/build-quickstart}
process=$build/src/tools/terrainseg-process
build_it() {
  begin=$SECONDS
  if [ ! -f "$build/build.ninja" ]; then
    echo "configuring ..."
    heartbeat "$build.log" meson setup "$build" -Dtests=disabled -Dbench=disabled -Dlab=disabled -Dunity-tools=true ||
      { tail -n 20 "$build.log" >&2; fail "could not configure the build; the whole log is $build.log"; }
  fi
  echo "building ..."
  heartbeat "$build.log" ninja -C "$build" quickstart ||
    { grep -m 1 -A 20 FAILED "$build.log" >&2 || tail -n 20 "$build.log" >&2; fail "could not build; the whole log is $build.log"; }
  echo "installed in $installed s, built in $((SECONDS - begin)) s"
}
[ -n "${QUICKSTART_BUILD:-}" ] || build_it
export GST_PLUGIN_PATH=$build/gst GST_REGISTRY=$build/registry.bin

# Only what is whole gets its name: whatever stops this run, what the last one left is still there.
mkdir -p "$results"
out=$(mktemp -d "$results/unfinished-XXXXXX")
trap 'rm -rf "$out"' EXIT
source=$video
if [ -z "$source" ]; then
  echo "rendering a scene ..."
  source=$results/scene.mp4
  # A drive that the filter sees well; docs/gallery.md shows others.
  heartbeat "$out/log" gst-launch-1.0 -q -e terrainscenesrc scene=trail seed=7 num-buffers=250 ! video/x-raw,format=I420,width=640,height=360,framerate=30/1 \
    ! x264enc pass=qual quantizer=16 speed-preset=veryfast ! mp4mux ! filesink "location=\"$out/scene.mp4\"" ||
    { tail -n 20 "$out/log" >&2; fail "the scene could not be rendered"; }
  mv "$out/scene.mp4" "$source"
fi

echo "running the filter on ${source#"$top"/} ..."
status=0
"$process" --output-dir "$out" --name '' --outputs annotated,masks,json ${settings[@]+"${settings[@]}"} -- "$source" >"$out/line" || status=$?
prefix=
if [ -f "$out/partial.summary.json" ]; then
  prefix=partial.
elif [ "$status" -ne 0 ]; then
  exit "$status" # terrainseg-process has said why
fi
/usr/bin/python3 - "$out/${prefix}summary.json" <<'PYTHON'
import json, sys
summary = json.load(open(sys.argv[1]))
frames, own = summary['frames'], summary['filter_milliseconds']
print(f'{frames} {"frame" if frames == 1 else "frames"} of {summary["width"]}x{summary["height"]} in {summary["seconds"]:.1f} s: '
      f'{summary["fps"]:.0f} frames per second, with decoding and encoding')
print(f'the filter itself: {own:.2f} ms a frame' + (f', {1000 / own:.0f} frames per second' if own > 0 else ''))
print(f'traversable: {100 * summary["traversable"]:.0f} % of the view')
if summary['still_rows']:
    print(f'the lowest {summary["still_rows"]} rows never change: try window-bottom={summary["still_rows"]} at the end of this command')
PYTHON

# Six frames from all over the clip, and their masks.
frames=$(wc -l <"$out/${prefix}terrain.jsonl")
every=$(((frames + 5) / 6))
pick="select='not(mod(n\\,$every))',scale=426:-2,tile=3x2:padding=4"
ffmpeg -nostdin -v error -y -i "$out/${prefix}annotated.mp4" -i "$out/${prefix}masks.mkv" -filter_complex \
  "[0:v]${pick}[a];[1:v]format=gray,${pick/scale=426:-2/scale=426:-2:flags=neighbor},format=rgb24[b];[a]format=rgb24[c];[c][b]vstack" \
  -frames:v 1 "$out/${prefix}preview.png" || fail "ffmpeg could not make the contact sheet"

names=(annotated.mp4 masks.mkv terrain.jsonl preview.png)
earlier=1
while [ -e "$results/earlier-$earlier" ]; do earlier=$((earlier + 1)); done
for name in "${names[@]}"; do
  [ -e "$results/$prefix$name" ] || continue
  mkdir -p "$results/earlier-$earlier"
  mv "$results/$prefix$name" "$results/earlier-$earlier/"
done
[ ! -e "$results/earlier-$earlier" ] || echo "the results of the last run are in $results/earlier-$earlier"
for name in "${names[@]}"; do
  mv "$out/$prefix$name" "$results/$prefix$name"
  echo "$results/$prefix$name"
done

quoted=$(printf '%q' "$source")
cat <<NEXT
To run the commands of README, pages and examples, open a shell: meson devenv -w $top -C $build
(examples/tune.sh also needs: ./install-dependencies.sh tune)
What next, in $top:
  examples/quickstart.sh $quoted caution=8    # another setting
  ${process#"$top"/} -o out $quoted    # many files, CSV, resuming: docs/tasks/files.md
  meson devenv -C ${build#"$top"/} gst-inspect-1.0 terrainseg    # every setting, and the filter in your own pipelines
NEXT
exit "$status"
