#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# usage: tests/fuzz/run.sh [check | SECONDS | night | coverage] [TARGET...]
#   check     as many inputs of each target as take about a minute, from the repository's corpus and one seed: the same inputs
#             each time, but for threads
#   SECONDS   that long for each target, from all inputs that are there (without a word: 60): SEED=number for another seed, 0 for any
#   night     two hours for each target
#   coverage  runs the inputs that are there, tests/fuzz/corpus and what earlier runs found, and says what none of them
#             reaches, by file: build-fuzz-coverage/report.txt
# As many targets run at once as there are processors (JOBS=1: one after the other).
# Builds the libFuzzer targets with Clang into build-fuzz, takes the corpus of the repository and what the encoders write
# as seeds, and runs. Ends with "N passed, N failed"; an input that breaks something stays in build-fuzz/findings.
set -u
cd "$(dirname "$0")/../.." || exit
. tests/ci/with_clang.sh
mode=${1:-60}
shift || true
targets=("$@")
[ ${#targets[@]} -gt 0 ] ||
  targets=(klv model_file model_frames motion metric mavlink stamp settings records terrainseg terraincombine terrainextract
    terrainoverlay terrainmcapsink ros_inputs)
seconds=$mode seed=${SEED:-1}
case $mode in
night) seconds=7200 seed=${SEED:-0} ;;
check | coverage) seconds=0 ;;
esac

command -v clang++ >/dev/null || { echo "fuzz: clang is not here: left out"; exit 77; }
build=build-fuzz
options=(-Dfuzz=true -Dtools=disabled -Dlab=disabled -Dbench=disabled)
if [ "$mode" = coverage ]; then
  build=build-fuzz-coverage
  profiling='-fprofile-instr-generate -fcoverage-mapping'
  options+=("-Dcpp_args=$profiling" -Dcpp_link_args=-fprofile-instr-generate)
fi
if [ ! -f "$build/build.ninja" ]; then
  rm -rf "$build"
  with_clang meson setup "$build" "${options[@]}" >"$build.log" 2>&1 ||
    { cat "$build.log"; exit 1; }
fi
# shellcheck disable=SC2046
with_clang ninja -C "$build" tests/fuzz/fuzz_seeds $(printf 'tests/fuzz/%s_fuzz ' "${targets[@]}") >"$build.log" 2>&1 ||
  { grep -E -A6 'error|FAILED' "$build.log"; exit 1; }

# Longest input in bytes, of each target.
longest() {
  case $1 in
  klv) echo 4096 ;;
  model_file | model_frames) echo 9000 ;;
  settings | records) echo 2048 ;;
  motion) echo 256 ;; # a frame takes as little as two bytes, and much time
  *) echo 1024 ;;
  esac
}

# What a minute holds on the slower of two machines, two targets at once.
runs_of_check() {
  case $1 in
  klv | model_file | stamp | ros_inputs) echo 1500000 ;;
  model_frames) echo 150000 ;;
  motion) echo 1200 ;; # drives
  metric) echo 120000 ;;
  mavlink) echo 240000 ;;
  settings) echo 20000 ;;
  records) echo 50000 ;;
  terrainseg) echo 3000 ;;
  terraincombine) echo 20000 ;;
  *) echo 8000 ;;
  esac
}
# Addresses are the same each time, too, where that may be asked for: libFuzzer's tables depend on them.
fixed=()
! setarch -R true 2>/dev/null || fixed=(setarch -R)

mkdir -p build-fuzz/{samples,findings}
export ASAN_OPTIONS=detect_leaks=0 G_SLICE=always-malloc
LLVM_PROFILE_FILE=$build/seeds.unused "$build/tests/fuzz/fuzz_seeds" build-fuzz/samples || exit 1
corpora=build-fuzz/corpus
if [ "$mode" = check ]; then
  corpora=build-fuzz/corpus-of-check
  rm -rf "$corpora"
fi
for target in "${targets[@]}"; do
  corpus=$corpora/$target
  mkdir -p "$corpus"
  [ ! -d "tests/fuzz/corpus/$target" ] || cp "tests/fuzz/corpus/$target"/* "$corpus/"
  case $target in
  klv) find build-fuzz/samples -name '*.klv' -size -5k -exec cp {} "$corpus/" \; ;;
  model_file) cp build-fuzz/samples/*.terrain "$corpus/" ;;
  model_frames) # decisions, then the content without header and checksum
    for file in build-fuzz/samples/*.terrain; do
      { printf '\x01'; tail -c +17 "$file" | head -c -4; } >"$corpus/$(basename "$file")"
    done ;;
  esac
done

if [ "$mode" = coverage ]; then
  objects=()
  for target in "${targets[@]}"; do
    LLVM_PROFILE_FILE="$build/$target.profraw" "$build/tests/fuzz/${target}_fuzz" -runs=0 \
      -max_len="$(longest "$target")" "build-fuzz/corpus/$target" >"$build/$target.log" 2>&1 ||
      { tail -n 20 "$build/$target.log"; exit 1; }
    # The first is the report's program, the others are named as objects.
    [ ${#objects[@]} -eq 0 ] || objects+=(-object)
    objects+=("$build/tests/fuzz/${target}_fuzz")
  done
  llvm-profdata merge -sparse "$build"/*.profraw -o "$build/all.profdata" || exit 1
  ours=(-instr-profile="$build/all.profdata" -ignore-filename-regex='^/usr|/tests/|/meson-')
  llvm-cov report "${objects[@]}" "${ours[@]}" >"$build/report.txt" 2>"$build/report.log"
  grep -q '^TOTAL' "$build/report.txt" || { cat "$build/report.log"; exit 1; }
  awk '$7 == "0.00%" || $1 == "TOTAL"' "$build/report.txt"
  echo "above: files of which no input reaches a function, and all together; every file: $build/report.txt"
  exit
fi

# Ends with the target's exit status in a file.
fuzz() {
  local status=0 inputs=("-max_total_time=$seconds" "$corpora/$1")
  if [ "$mode" = check ]; then # a folder's order is the file system's
    find "$corpora/$1" -type f | sort | paste -sd, >"$build/$1.seeds"
    inputs=("-runs=$(runs_of_check "$1")" "-seed_inputs=@$build/$1.seeds")
  fi
  "${fixed[@]}" "$build/tests/fuzz/${1}_fuzz" -seed="$seed" -max_len="$(longest "$1")" -timeout=20 -detect_leaks=0 \
    -rss_limit_mb=2560 -print_final_stats=1 -artifact_prefix="$build/findings/$1-" "${inputs[@]}" \
    >"$build/$1.fuzz.log" 2>&1 || status=$?
  echo "$status" >"$build/$1.status"
}
for target in "${targets[@]}"; do
  rm -f "$build/$target.status"
  while [ "$(jobs -rp | wc -l)" -ge "${JOBS:-$(nproc)}" ]; do
    wait -n
  done
  fuzz "$target" &
done
wait

passed=0 failed=0
for target in "${targets[@]}"; do
  log=$build/$target.fuzz.log
  if [ "$(cat "$build/$target.status" 2>/dev/null)" = 0 ]; then
    echo "$target: $(grep -oE 'Done [0-9]+ runs in [0-9]+ s' "$log")," \
      "$(sed -n 's/^stat::average_exec_per_sec: *//p' "$log") a second, cov $(grep -oE 'cov: [0-9]+' "$log" | tail -n 1 | cut -c6-)"
    passed=$((passed + 1))
  else
    echo "$target: FAILED"
    tail -n 30 "$log"
    failed=$((failed + 1))
  fi
done
echo "$passed passed, $failed failed"
[ "$failed" -eq 0 ]
