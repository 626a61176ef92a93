# SPDX-License-Identifier: LGPL-2.1-or-later
# Progress of commands that run for long without output. install-dependencies.sh and quickstart.sh source this file.

# running PID: the files that the children of a process make, such as ninja's compilers.
running() {
  local child command
  for child in $(cat "/proc/$1/task/$1/children" 2>/dev/null); do
    command=$(tr '\0' ' ' 2>/dev/null <"/proc/$child/cmdline") || continue
    [[ ! $command =~ \ -o\ ([^ ]+) ]] || printf ' %s' "${BASH_REMATCH[1]##*/}"
  done
}

# heartbeat LOG COMMAND...: runs a command with its output in the file LOG, and every five seconds shows what it does:
# "[123/254] making frame.cpp.o" while ninja runs a step (its own lines name those that have ended), else the last line
# of the log, "waiting ..." while there is none. Gives the command's status.
heartbeat() {
  local log=$1 shown="" line steps status=0 worker beat=$SECONDS
  shift
  : >"$log"
  "$@" >>"$log" 2>&1 &
  worker=$!
  while kill -0 "$worker" 2>/dev/null; do
    sleep 0.2
    [ $((SECONDS - beat)) -ge 5 ] || continue
    beat=$SECONDS
    line=$(tail -c 2000 "$log" | tr '\r' '\n' | grep -v '^[[:space:]]*$' | tail -n 1 | cut -c 1-110) || line=""
    line=${line:-waiting ...}
    steps=$(running "$worker")
    [ -z "$steps" ] || [[ ! $line =~ ^\[[0-9]+/[0-9]+\] ]] || line="${BASH_REMATCH[0]} making${steps:0:90}"
    if [ "$line" = "$shown" ]; then echo "  $line (still)"; else echo "  $line"; fi
    shown=$line
  done
  wait "$worker" || status=$?
  return "$status"
}
