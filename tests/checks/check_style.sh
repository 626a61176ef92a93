#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Format, licence lines, and left-overs. Prints what is wrong; exit status 1 when anything is.
set -uo pipefail
cd "$(dirname "$0")/../.."
bad=0
complain() { echo "style: $*"; bad=1; }

files=$(git ls-files -co --exclude-standard 2>/dev/null) || files=$(find . -type f -not -path './build*' -not -path './.git/*' | sed 's|^\./||')
sources=$(grep -E '\.(c|h|cpp|hpp)$' <<<"$files")
scripts=$(grep -E '\.(sh|py)$|(^|/)meson\.build$' <<<"$files")

# Another major version of clang-format has another taste: the one of Debian 12 decides.
formatter=$(command -v clang-format-14 || command -v clang-format || true)
if [ -n "$formatter" ] && "$formatter" --version | grep -q 'version 14\.'; then
  # shellcheck disable=SC2086
  "$formatter" --dry-run -Werror $sources 2>&1 | grep -E 'error:' | cut -d: -f1 | sort | uniq -c | while read -r n file; do
    echo "style: $file: $n places are not as clang-format 14 writes them"
  done
  # shellcheck disable=SC2086
  "$formatter" --dry-run -Werror $sources >/dev/null 2>&1 || bad=1
else
  echo "style: clang-format 14 is not here; the format was not checked"
fi

for file in $sources $scripts; do
  head -n 3 "$file" | grep -q 'SPDX-License-Identifier: LGPL-2.1-or-later' || complain "$file: no SPDX line"
done
for file in $(grep -E '\.(sh|py)$' <<<"$files"); do
  if head -c 2 "$file" | grep -q '#!'; then
    [ -x "$file" ] || complain "$file: has an interpreter line but is not executable"
  fi
done
left_overs='TO''DO|FIX''ME|X''XX|HA''CK'
found=$(grep -nE "\b($left_overs)\b" $sources $scripts | head -n 5)
[ -z "$found" ] || complain "left-overs: $found"
exit "$bad"
