#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# clang-tidy 14, with the checks of .clang-tidy, over the sources of src/ and gst/ and their headers: a finding is a failure.
# usage: tests/ci/tidy.sh [--turn | FILE...]
#   --turn   sources that changed in the last four hours before the last commit, and a quarter of the others, chosen by the commit's
#            hash; at most 70
set -euo pipefail
cd "$(dirname "$0")/../.."
./install-dependencies.sh build test
# Another major version has other checks, as with clang-format: the one of Debian 12 decides.
tidy=$(command -v clang-tidy-14) || { echo "tidy.sh: clang-tidy 14 is not here; nothing was checked" >&2; exit 1; }
[ -f build-tidy/build.ninja ] ||
  CC=clang CXX=clang++ meson setup build-tidy -Dtests=disabled -Dbench=disabled -Db_pch=false -Dunity-tools=false >build-tidy.log || { cat build-tidy.log >&2; exit 1; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# A check that finds nothing must be one that could.
printf 'int *wrong(int n) { int *p = 0; if (n) return p; return p + *p; }\n' >"$work/wrong.cpp"
if "$tidy" --quiet --config-file=.clang-tidy "$work/wrong.cpp" -- -std=c++20 >"$work/wrong.log" 2>&1; then
  echo "tidy.sh: clang-tidy passes a null pointer that is read" >&2
  exit 1
fi

# Names that belong to the compiler and its library. The check of clang-tidy, bugprone-reserved-identifier, tells the thousands of the
# system's headers one by one before it drops them, a seventh of all its time: here they are found by how they are spelled. A suffix of a
# literal must begin with an underscore.
theirs='__restrict|__attribute__|__x86_64__|__builtin_\w+|_mm(256|512)?_\w+|_gst_meta_transform_copy|__VA_ARGS__|__FILE__|__LINE__|__clang__|_PC_NAME_MAX'
reserved() {
  grep -nHoP "(?://.*|\"(?:[^\"\\\\]|\\\\.)*\"(?:_[a-z][a-z0-9]*)?|'(?:[^'\\\\]|\\\\.)')(*SKIP)(*F)|(?<!\w)(?!(?:$theirs)(?!\w))(?:_\w+|\w*__\w*)" "$@"
}
printf '#define _Wrong 1\nint __wrong;\nint _wrong();\nstruct A { int wrong__too; };\n/// not_a_\\_name, __nor this\nint fine_ = __builtin_abs(1); // __no\nconst char* s = "__no";\nauto t = "no"_own;\n' >"$work/names.cpp"
if [ "$(reserved "$work/names.cpp" | cut -d: -f2 | tr '\n' ' ')" != '1 2 3 4 ' ]; then
  echo "tidy.sh: of names that are reserved it finds: $(reserved "$work/names.cpp")" >&2
  exit 1
fi
mapfile -t ours < <(git ls-files 'src/*.[ch]pp' 'gst/*.[ch]pp' 'lab/[egr]*.[ch]pp' 'include/*.h' 'include/*.hpp')
if reserved "${ours[@]}"; then
  echo "tidy.sh: the names above are the compiler's"
  exit 1
fi

mapfile -t files < <(git ls-files 'src/*.cpp' 'gst/*.cpp' 'lab/[egr]*.cpp')
if [ "${1:-}" = --turn ]; then
  base=$(git rev-list -1 --before="$(($(git log -1 --format=%ct) - 4 * 3600))" HEAD)
  turn=$((16#$(git rev-parse --short=7 HEAD) % 4))
  mapfile -t files < <({
    git diff --name-only --diff-filter=d "${base:-HEAD}" HEAD -- 'src/*.cpp' 'gst/*.cpp' 'lab/[egr]*.cpp' | sort --random-source=<(git rev-parse HEAD) -R
    printf '%s\n' "${files[@]}" | awk -v turn="$turn" 'NR % 4 == turn'
  } | awk '!seen[$0]++' | head -n 70)
elif [ $# -gt 0 ]; then
  files=("$@")
fi
status=0
printf '%s\0' "${files[@]}" | xargs -0 -n 1 -P "$(nproc)" "$tidy" -p build-tidy --quiet >"$work/found" 2>"$work/log" || status=$?
grep -E -A3 '(warning|error):' "$work/found" || true
[ "$status" -eq 0 ] || { grep -E 'error' "$work/log" || true; echo "tidy.sh: the findings above"; exit 1; }
echo "tidy.sh: no finding in ${#files[@]} files ($SECONDS s)"
