#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Runs the tests, then every slow check, about two hours on two cores. The last line is "N passed, N failed".
# usage: tests/night.sh [WORD...]     WORD: only the slow checks whose command contains it
set -uo pipefail
cd "$(dirname "$0")/.."
. tests/ci/slow_checks.sh
[ $# -gt 0 ] || check tests/run.sh release sanitizers style
for row in "${slow_checks[@]}"; do
  IFS='|' read -r _ _ command <<<"$row"
  command=${command% --turn}
  wanted=$#
  for word in "$@"; do [[ $command != *"$word"* ]] || wanted=0; done
  [ "$wanted" -eq 0 ] || continue
  # shellcheck disable=SC2086
  check $command
done
echo "$passed passed, $failed failed"
[ "$failed" -eq 0 ] && [ "$passed" -gt 0 ]
