#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# usage: tests/fuzz/run.sh [SECONDS | night | coverage] [TARGET...]
#   SECONDS   that long for each target (60)
#   night     two hours for each target
#   coverage  runs the inputs that are there, tests/fuzz/corpus and what earlier runs found, and says what none of them
#             reaches, by file: build-fuzz-coverage/report.txt
# Builds the libFuzzer targets with Clang into build-fuzz, takes the corpus of the repository and what the encoders write
# as seeds, and runs. Ends with "N passed, N failed"; an input that breaks something stays in build-fuzz/findings.
set -u
cd "$(dirname "$0")/../.."
mode=${1:-60}
shift || true
targets=("$@")
[ ${#targets[@]} -gt 0 ] || targets=(klv model_file model_frames metric terrainseg terraincombine)
seconds=$mode
[ "$mode" != night ] || seconds=7200

build=build-fuzz
options=(-Dfuzz=true -Dtools=disabled -Dbench=disabled)
if [ "$mode" = coverage ]; then
  build=build-fuzz-coverage
  profiling='-fprofile-instr-generate -fcoverage-mapping'
  options+=("-Dcpp_args=$profiling" -Dcpp_link_args=-fprofile-instr-generate)
fi
if [ ! -f "$build/build.ninja" ]; then
  rm -rf "$build"
  CC=clang CXX=clang++ meson setup "$build" "${options[@]}" >"$build.log" 2>&1 || { cat "$build.log"; exit 1; }
fi
# shellcheck disable=SC2046
ninja -C "$build" tests/fuzz/fuzz_seeds $(printf 'tests/fuzz/%s_fuzz ' "${targets[@]}") >"$build.log" 2>&1 ||
  { grep -E -A6 'error|FAILED' "$build.log"; exit 1; }

# Longest input in bytes, of each target.
longest() {
  case $1 in
  klv) echo 4096 ;;
  model_file | model_frames) echo 9000 ;;
  *) echo 1024 ;;
  esac
}

mkdir -p build-fuzz/{samples,findings}
export ASAN_OPTIONS=detect_leaks=0 G_SLICE=always-malloc
LLVM_PROFILE_FILE=$build/seeds.unused "$build/tests/fuzz/fuzz_seeds" build-fuzz/samples || exit 1
for target in "${targets[@]}"; do
  corpus=build-fuzz/corpus/$target
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

passed=0 failed=0
for target in "${targets[@]}"; do
  log=$build/$target.fuzz.log
  if "$build/tests/fuzz/${target}_fuzz" -max_total_time="$seconds" -max_len="$(longest "$target")" -timeout=10 -detect_leaks=0 \
      -rss_limit_mb=1536 -artifact_prefix="$build/findings/$target-" "$build/corpus/$target" >"$log" 2>&1; then
    echo "$target: $(grep -E 'Done [0-9]+ runs' "$log") ($(grep -E 'cov:' "$log" | tail -n 1 | sed 's/.*\(cov: [0-9]*\).*/\1/'))"
    passed=$((passed + 1))
  else
    echo "$target: FAILED"
    tail -n 30 "$log"
    failed=$((failed + 1))
  fi
done
echo "$passed passed, $failed failed"
[ "$failed" -eq 0 ]
