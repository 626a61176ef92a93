#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# A list of recordings in shards on this machine, by GNU parallel: examples/fleet/parallel.sh LIST OUT SHARDS [OPTION...]
# A shard that may succeed when tried again (exit code 75, or killed) runs up to three times.
set -uo pipefail
[ $# -ge 3 ] || { sed -n '3s/^# //p' "$0"; exit 2; }
list=$1 out=$2 shards=$3
shift 3
[[ $shards =~ ^[1-9][0-9]*$ ]] || { echo "parallel.sh: SHARDS is a number from 1, not '$shards'" >&2; exit 2; }
[ -r "$list" ] || { echo "parallel.sh: cannot read the list $list" >&2; exit 2; }
for program in parallel terrainseg-process; do
  command -v "$program" >/dev/null || { echo "parallel.sh: $program is not in the path (parallel: apt-get install parallel; terrainseg-process: install it, or meson devenv -w . -C build)" >&2; exit 3; }
done
mkdir -p "$out/manifests"
export list out shards
shard() {
  for _ in 1 2 3; do
    terrainseg-process --quiet --resume --output-dir "$out" --inputs-from "$list" --shard "$1/$shards" \
      --manifest "$out/manifests/shard-$1.jsonl" "${@:2}"
    code=$?
    case $code in 75 | 137) ;; *) return "$code" ;; esac
  done
  return "$code"
}
export -f shard
SHELL=/bin/bash parallel --will-cite --quote shard {} "$@" ::: $(seq "$shards")
failed=$?
cat "$out"/manifests/shard-*.jsonl | terrainseg-process --check - --inputs-from "$list" --output-dir "$out" || exit
exit "$failed"
