#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Installs what is missing, builds, tests; the last line is "N passed, N failed".
# usage: tests/run.sh [release] [sanitizers] [style]     without words: release and style
#   release      GCC, all tests but the slow ones
#   sanitizers   Clang with the address and undefined behaviour sanitizers: unit, element and golden tests once more, from a clean
#                clone as long as the release. For what touches pixels or reads input; .ci/run always does it
#   style        formatting, who may include whom, and commits that pages name
set -uo pipefail
cd "$(dirname "$0")/.."
top=$PWD
parts=("$@")
[ ${#parts[@]} -gt 0 ] || parts=(release style)
for part in "${parts[@]}"; do
  [[ $part =~ ^(release|sanitizers|style)$ ]] || { sed -n '4,8s/^# //p' "$0" >&2; exit 2; }
done
wants() { [[ " ${parts[*]} " == *" $1 "* ]]; }

passed=0
failed=0
count() { passed=$((passed + $1)); failed=$((failed + $2)); }
finish() {
  echo "$passed passed, $failed failed"
  [ "$failed" -eq 0 ] && [ "$passed" -gt 0 ]
  exit
}
. examples/heartbeat.sh
. tests/ci/with_clang.sh
step() { printf '\n== %s (%s s)\n' "$1" "$SECONDS"; }

./install-dependencies.sh test || { count 0 1; finish; }

# configure_and_build FOLDER OPTIONS...: a build that fails is one failed check and says what the compiler said.
configure_and_build() {
  local folder=$1
  shift
  if [ -f "$folder/build.ninja" ]; then
    meson setup --reconfigure "$folder" "$@" >"$folder.log" 2>&1
  else
    meson setup "$folder" "$@" >"$folder.log" 2>&1
  fi || { tail -n 30 "$folder.log"; echo "FAILED: configuring $folder"; count 0 1; return 1; }
  heartbeat "$folder.log" ninja -k 0 -C "$folder" || {
    grep -E -A6 'error|warning|FAILED' "$folder.log" | head -n 60
    echo "FAILED: building $folder (see $folder.log)"
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
    mapfile -t again < <(/usr/bin/python3 tests/checks/count_results.py --real-time "$folder/meson-logs")
    if [ ${#again[@]} -gt 0 ]; then
      printf '== once more, alone: %s\n' "${again[@]}"
      meson test -C "$folder" --no-rebuild --print-errorlogs "$@" --num-processes 1 --logbase again "${again[@]}" || true
    fi
  fi
  result=$(/usr/bin/python3 tests/checks/count_results.py "$folder/meson-logs") || { count 0 1; return; }
  echo "$folder: $result"
  read -r ok bad <<<"$result"
  count "$ok" "$bad"
}

# ccache, where it is, gives what uses a precompiled header only with the first two.
export CCACHE_SLOPPINESS=${CCACHE_SLOPPINESS:-pch_defines,time_macros,include_file_mtime,include_file_ctime}

# Warnings are errors with the compilers of the base system. GCC 14 warns inside its own vectors, of code that is right.
werror=-Dwerror=false
[ "$(gcc -dumpversion)" != 12 ] || werror=-Dwerror=true

ahead=
build_sanitizers() {
  # Of debug information the lines, which is what a report names.
  with_clang configure_and_build build-sanitizers --werror -Doptimization=2 -Ddebug=false \
    -Dc_args=-gline-tables-only -Dcpp_args="-gline-tables-only -D_GLIBCXX_ASSERTIONS" -Db_sanitize=address,undefined -Db_lundef=false -Dtools=disabled -Dlab=disabled -Dbench=disabled
}
# Compiles for the sanitizers in what the tests of the release leave of the processors; those that run alone wait for most of their time.
begin_sanitizers() {
  set -m
  { renice -n 19 "$BASHPID" && build_sanitizers; } >/dev/null 2>&1 &
  ahead=$!
  set +m
  trap end_begun EXIT
}
end_begun() {
  [ -z "$ahead" ] || { kill -- "-$ahead"; wait "$ahead"; } 2>/dev/null
  ahead=
}

if wants release; then
  step "GCC $(gcc -dumpversion), release"
  if configure_and_build build-release "$werror" -Dtests=enabled -Dunity-tools=true; then
    ! wants sanitizers || begin_sanitizers
    run_tests build-release --num-processes 3 --no-suite slow
    end_begun
  fi
fi

if wants sanitizers; then
  step "Clang, address and undefined behaviour sanitizers"
  if build_sanitizers; then
    ASAN_OPTIONS=detect_leaks=0:detect_odr_violation=1 UBSAN_OPTIONS=halt_on_error=1:print_stacktrace=1 \
      GST_REGISTRY_FORK=no TERRAINSEG_SANITIZED=1 TERRAINSEG_PATIENCE=4 \
      run_tests build-sanitizers --num-processes 3 --timeout-multiplier 4 --suite unit --suite element --suite golden
  fi
fi

if wants style; then
  step "style and the arrows of the house"
  for check in tests/checks/check_style.sh tests/checks/check_house.py "tests/checks/check_house.py --self-check"; do
    # shellcheck disable=SC2086
    if "$top/"$check; then count 1 0; else count 0 1; echo "FAILED: $check"; fi
  done
fi
finish
