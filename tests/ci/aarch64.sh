#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# The core built for AArch64 with a cross compiler and run under qemu-user: every kernel on every target that qemu
# has, and the masks of all formats, which must have the hashes of this machine. Installs what it needs; nothing
# of the foreign architecture is installed on this machine, its packages are unpacked in a folder.
# usage: tests/ci/aarch64.sh [FOLDER]     FOLDER: where it builds (default: build-aarch64). BUILD=folder: a build of these sources,
# whose core makes the hashes of this machine; without it the core is compiled for that too. Ends with "N passed, N failed".
set -uo pipefail
cd "$(dirname "$0")/../.."
folder=${1:-build-aarch64}
mkdir -p "$folder/apt/lists/partial" "$folder/apt/cache/archives/partial" "$folder/cross" "$folder/native"
folder=$(cd "$folder" && pwd)
passed=0
failed=0
finish() {
  echo "$passed passed, $failed failed"
  [ "$failed" -eq 0 ] && [ "$passed" -gt 0 ]
  exit
}
fail() {
  echo "$1"
  failed=$((failed + 1))
  finish
}

as_root() { if [ "$(id -u)" -eq 0 ]; then "$@"; else sudo "$@"; fi; }
missing=()
command -v aarch64-linux-gnu-g++ >/dev/null || missing+=(g++-aarch64-linux-gnu)
command -v qemu-aarch64 >/dev/null || missing+=(qemu-user)
[ -d /usr/src/googletest ] || missing+=(googletest)
[ -f /usr/include/hwy/highway.h ] || missing+=(libhwy-dev)
if [ ${#missing[@]} -gt 0 ]; then
  as_root apt-get install -y --no-install-recommends "${missing[@]}" >"$folder/apt.log" 2>&1 ||
    fail "cannot install ${missing[*]} (see $folder/apt.log)"
fi

# Highway for AArch64: fetched with package lists of our own, so that the system keeps its one architecture.
root=$folder/root
if [ ! -f "$root/usr/lib/aarch64-linux-gnu/libhwy.so" ]; then
  foreign=(-o "APT::Architectures::=$(dpkg --print-architecture)" -o APT::Architectures::=arm64
    -o "Dir::State::Lists=$folder/apt/lists" -o "Dir::Cache=$folder/apt/cache" -o APT::Sandbox::User=root
    -o APT::Update::Post-Invoke-Success::=true)
  { apt-get "${foreign[@]}" update &&
    (cd "$folder/apt" && apt-get "${foreign[@]}" download libhwy1:arm64 libhwy-dev:arm64) &&
    for package in "$folder"/apt/*.deb; do dpkg -x "$package" "$root"; done; } >"$folder/apt.log" 2>&1 ||
    fail "cannot fetch libhwy for arm64 (see $folder/apt.log)"
fi

mapfile -t core < <(find src -name '*.cpp' -not -path 'src/scene/*' -not -path 'src/tools/*' -not -path 'src/metric/*' -not -path 'src/recording/*' -not -path 'src/ros2/*')
gtest=/usr/src/googletest/googletest
flags=(-std=c++20 -O3 -Iinclude -Isrc -I"$gtest" -I"$gtest/include" -pthread)

# build OUT COMPILER OPTIONS...: the kernels' test and the hashes.
build() {
  local out=$1 compiler=$2
  shift 2
  rm -f "$out"/*.o # of sources that are gone
  {
    for source in "${core[@]}" tests/aarch64/hashes.cpp; do
      printf '%s/%s.o: %s\n\t%s %s -c $< -o $@\n' "$out" "$(tr / _ <<<"$source")" "$source" "$compiler" \
        "${flags[*]} -Wall -Wextra -Werror $*"
      objects="${objects-} $out/$(tr / _ <<<"$source").o"
    done
    printf '%s/gtest.o: %s\n\t%s %s -c $< -o $@\n' "$out" "$gtest/src/gtest-all.cc" "$compiler" "${flags[*]}"
    printf '%s/kernels_test.o: %s\n\t%s %s -c $< -o $@\n' "$out" tests/unit/kernels_test.cpp "$compiler" \
      "${flags[*]} $*"
    printf '%s/gtest_main.o: %s\n\t%s %s -c $< -o $@\n' "$out" "$gtest/src/gtest_main.cc" "$compiler" "${flags[*]}"
    printf 'all:%s %s/gtest.o %s/gtest_main.o %s/kernels_test.o\n' "$objects" "$out" "$out" "$out"
  } >"$out/Makefile"
  unset objects
  make -B -s -j2 -f "$out/Makefile" all >"$out/log" 2>&1 || { tail -n 30 "$out/log"; return 1; }
  local parts
  parts=$(ls "$out"/src_*.o)
  # shellcheck disable=SC2086
  $compiler -pthread -o "$out/hashes" $parts "$out/tests_aarch64_hashes.cpp.o" "${link[@]}" -lhwy &&
    $compiler -pthread -o "$out/kernels_test" $parts "$out"/gtest.o "$out"/gtest_main.o "$out/kernels_test.o" \
      "${link[@]}" -lhwy
}

# Highway's headers are the same for every architecture; only its library is foreign.
mkdir -p "$folder/include"
ln -sfn "$root/usr/include/hwy" "$folder/include/hwy"
if [ -f "${BUILD:-}/src/libterrainseg_core.a" ]; then
  # shellcheck disable=SC2086
  ${CXX:-g++} ${flags[*]} -o "$folder/native/hashes" tests/aarch64/hashes.cpp "$BUILD/src/libterrainseg_core.a" -lhwy ||
    fail "the native build failed"
else
  link=()
  build "$folder/native" "${CXX:-g++}" || fail "the native build failed"
fi
link=(-L"$root/usr/lib/aarch64-linux-gnu")
build "$folder/cross" aarch64-linux-gnu-g++ -isystem "$folder/include" || fail "the cross build failed"

# vector_bytes: of SVE; NEON does not care.
vector_bytes=64
emulated() { qemu-aarch64 -cpu "max,sve-default-vector-length=$vector_bytes" -L /usr/aarch64-linux-gnu -E LD_LIBRARY_PATH="$root/usr/lib/aarch64-linux-gnu" "$@"; }
for vector_bytes in 16 32 64 128; do
  if emulated "$folder/cross/kernels_test" --gtest_output="xml:$folder/kernels.xml" >"$folder/kernels.log" 2>&1; then
    echo "SVE vectors of $vector_bytes bytes:" \
      "$(grep -o 'name="targets" value="[^"]*"' "$folder/kernels.xml" | sort -u | cut -d'"' -f4)"
  else
    tail -n 30 "$folder/kernels.log"
  fi
  passed=$((passed + $(grep -c '^\[       OK' "$folder/kernels.log")))
  failed=$((failed + $(grep -c '^\[  FAILED  \].*ms)' "$folder/kernels.log")))
done

"$folder/native/hashes" >"$folder/native.txt" && emulated "$folder/cross/hashes" >"$folder/aarch64.txt" ||
  fail "the hashes program failed"
if [ -s "$folder/native.txt" ] && diff "$folder/native.txt" "$folder/aarch64.txt"; then
  echo "$(wc -l <"$folder/native.txt") hashes are those of this machine"
  passed=$((passed + $(wc -l <"$folder/native.txt")))
else
  failed=$((failed + 1))
fi
finish
