#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Follows Containerfile line by line in a clean Debian root (debootstrap in place of FROM), then runs its entry point on a
# rendered scene. Needs root. usage: tests/containerfile.sh [FOLDER]     FOLDER: where the root lies
# (default: /var/tmp/terrainseg-container). Ends with "N passed, N failed".
set -uo pipefail
cd "$(dirname "$0")/.."
. tests/debian_root.sh
root=${1:-/var/tmp/terrainseg-container}
passed=0
failed=0
finish() {
  leave_root "$root"
  echo "$passed passed, $failed failed"
  [ "$failed" -eq 0 ] && [ "$passed" -gt 0 ]
  exit
}
check() { # check NAME COMMAND...
  local name=$1
  shift
  if "$@" >"$root.log" 2>&1; then
    passed=$((passed + 1)); echo "ok: $name"
  else
    failed=$((failed + 1)); echo "FAILED: $name"; tail -n 20 "$root.log"; finish
  fi
}
debian_root bookworm "$root" || exit 1
workdir=/ entry=
while read -r word rest; do
  case "$word" in
    "" | \#*) ;;
    FROM) check "FROM $rest is what the root is" [ "$rest" = debian:12 ] ;;
    WORKDIR) workdir=$rest; rm -rf "${root:?}$rest" "${root:?}/build"; mkdir -p "$root$rest" ;;
    COPY) check "COPY $rest" copy_source "$root${rest#. }" ;;
    RUN) check "RUN $rest" in_root "$root" sh -c "cd $workdir && $rest" ;;
    ENTRYPOINT) entry=$(tr -d '[]",' <<<"$rest") ;;
    *) check "a line that this script knows: $word" false ;;
  esac
done <Containerfile
check "the entry point runs the filter" in_root "$root" sh -c "cd /tmp && rm -rf out && gst-launch-1.0 -q -e terrainscenesrc num-buffers=10 \
  ! video/x-raw,format=I420,width=160,height=96 ! x264enc ! mp4mux ! filesink location=drive.mp4 && $entry --output-dir out drive.mp4 &&
  [ \$(wc -l <out/drive.jsonl) -eq 10 ]"
finish
