# SPDX-License-Identifier: LGPL-2.1-or-later
# Commands that take long without a word; install-dependencies.sh and quickstart.sh source this.

# heartbeat LOG COMMAND...: runs a command with its output in the file LOG, and every five seconds shows the last line of
# it: "[123/254] Compiling ...", "waiting ..." while there is none. Gives the command's status.
heartbeat() {
  local log=$1 shown="" line status=0 worker beat=$SECONDS
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
    if [ "$line" = "$shown" ]; then echo "  $line (still)"; else echo "  $line"; fi
    shown=$line
  done
  wait "$worker" || status=$?
  return "$status"
}
