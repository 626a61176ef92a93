#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# usage: tests/fuzz/run.sh [RUNS]    default 200000 inputs a target; the release check is 10000000
# Builds the libFuzzer targets with Clang into build-fuzz, makes seeds from what the encoders write, and runs. Ends with
# "N passed, N failed"; an input that breaks something stays in build-fuzz/findings.
set -u
cd "$(dirname "$0")/../.."
runs=${1:-200000}
build=build-fuzz
if [ ! -d "$build" ]; then
  CC=clang CXX=clang++ meson setup "$build" -Dfuzz=true -Dtools=disabled -Dbench=disabled >"$build.log" 2>&1 ||
    { cat "$build.log"; exit 1; }
fi
ninja -C "$build" tests/fuzz/klv_fuzz tests/fuzz/model_file_fuzz tests/unit/exchange_samples >"$build.log" 2>&1 ||
  { grep -E -A6 'error|FAILED' "$build.log"; exit 1; }

mkdir -p "$build"/{samples,findings,corpus/klv,corpus/model_file}
"$build/tests/unit/exchange_samples" "$build/samples" || exit 1
for file in "$build"/samples/*.klv; do
  [ "$(stat -c %s "$file")" -le 4096 ] && cp "$file" "$build/corpus/klv/"
done
cp "$build"/samples/*.terrain "$build/corpus/model_file/"

passed=0 failed=0
for target in klv model_file; do
  longest=4096
  [ "$target" = model_file ] && longest=9000
  log=$build/$target.fuzz.log
  if "$build/tests/fuzz/${target}_fuzz" -runs="$runs" -max_len=$longest -timeout=10 -rss_limit_mb=1024 \
      -artifact_prefix="$build/findings/$target-" "$build/corpus/$target" >"$log" 2>&1; then
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
