#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Installs what is missing, builds, runs all tests; the last line is "N passed, N failed".
# usage: tests/run.sh [release] [sanitizers] [style]     without words: all three
set -uo pipefail
cd "$(dirname "$0")/.."
top=$PWD
parts=("$@")
[ ${#parts[@]} -gt 0 ] || parts=(release sanitizers style)
wants() { [[ " ${parts[*]} " == *" $1 "* ]]; }

passed=0
failed=0
count() { passed=$((passed + $1)); failed=$((failed + $2)); }
finish() {
  echo "$passed passed, $failed failed"
  [ "$failed" -eq 0 ] && [ "$passed" -gt 0 ]
  exit
}
step() { printf '\n== %s (%s s)\n' "$1" "$SECONDS"; }

./install-dependencies.sh test || { count 0 1; finish; }

# configure_and_build FOLDER OPTIONS...: a build that fails is one failed check and says what the compiler said.
configure_and_build() {
  local folder=$1
  shift
  if [ -d "$folder" ]; then
    meson setup --reconfigure "$folder" "$@" >"$folder.log" 2>&1
  else
    meson setup "$folder" "$@" >"$folder.log" 2>&1
  fi || { tail -n 30 "$folder.log"; echo "configuring $folder failed"; count 0 1; return 1; }
  ninja -k 0 -C "$folder" >"$folder.log" 2>&1 || {
    grep -E -A6 'error|warning|FAILED' "$folder.log" | head -n 60
    echo "building $folder failed (see $folder.log)"
    count 0 1
    return 1
  }
}

# run_tests FOLDER ARGUMENTS...: counts every case of every GoogleTest program and every script. What measures real time and failed beside
# others is tried once more, alone, and named; its second try counts.
run_tests() {
  local folder=$1 result again=()
  shift
  find "$folder/tests" -name '*.xml' -delete 2>/dev/null
  rm -f "$folder/meson-logs/again".*
  if ! meson test -C "$folder" --no-rebuild --print-errorlogs "$@"; then
    mapfile -t again < <(/usr/bin/python3 tests/count_results.py --real-time "$folder/meson-logs")
    if [ ${#again[@]} -gt 0 ]; then
      printf '== once more, alone: %s\n' "${again[@]}"
      meson test -C "$folder" --no-rebuild --print-errorlogs "$@" --num-processes 1 --logbase again "${again[@]}" || true
    fi
  fi
  result=$(/usr/bin/python3 tests/count_results.py "$folder/meson-logs") || { count 0 1; return; }
  echo "$folder: $result"
  read -r ok bad <<<"$result"
  count "$ok" "$bad"
}

# Warnings are errors with the compilers of the base system. GCC 14 warns inside its own vectors, of code that is right.
werror=-Dwerror=false
[ "$(gcc -dumpversion)" != 12 ] || werror=-Dwerror=true

if wants release; then
  step "GCC $(gcc -dumpversion), release"
  configure_and_build build-release "$werror" -Dtests=enabled &&
    run_tests build-release --num-processes 3 --no-suite slow
fi

if wants sanitizers; then
  step "Clang, address and undefined behaviour sanitizers"
  # Of debug information the lines, which is what a report names.
  if CC=clang CXX=clang++ configure_and_build build-sanitizers --werror -Doptimization=2 -Ddebug=false \
      -Dc_args=-gline-tables-only -Dcpp_args="-gline-tables-only -D_GLIBCXX_ASSERTIONS" -Db_sanitize=address,undefined -Db_lundef=false -Dtools=disabled -Dbench=disabled; then
    ASAN_OPTIONS=detect_leaks=0:detect_odr_violation=1 UBSAN_OPTIONS=halt_on_error=1:print_stacktrace=1 \
      GST_REGISTRY_FORK=no TERRAINSEG_SANITIZED=1 \
      run_tests build-sanitizers --num-processes 3 --timeout-multiplier 4 --suite unit --suite element --suite golden
  fi
fi

if wants style; then
  step "style and the arrows of the house"
  for check in tests/check_style.sh tests/check_house.py "tests/check_house.py --self-check"; do
    # shellcheck disable=SC2086
    if "$top/"$check; then count 1 0; else count 0 1; fi
  done
fi
finish
