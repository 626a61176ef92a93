#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Starts a real Slurm of one node (munge, slurmctld, slurmd of Debian), runs 40 recordings in four shards, kills one task
# and puts one back into the queue, and compares names and bytes with one run that is not sharded. Then the same by GNU
# parallel, and what can be said of the Kubernetes Job without a cluster. Needs root; BUILD=folder (build-release).
set -uo pipefail
cd "$(dirname "$0")/../.."
[ "$(id -u)" -eq 0 ] || { echo "skipped: slurmd wants root"; exit 77; }
./install-dependencies.sh fleet || exit 1
top=$PWD
build=$top/${BUILD:-build-release}
faults=$build/tests/tools/faults.so
ninja -C "$build" gst/libgstterrainseg.so src/tools/terrainseg-process tests/tools/faults.so >"$build/fleet-build.log" 2>&1 || { tail -n 20 "$build/fleet-build.log"; exit 1; }
work=$(mktemp -d)
chmod 755 "$work"
export PATH=$build/src/tools:$PATH GST_PLUGIN_PATH=$build/gst GST_REGISTRY=$work/registry.bin LC_ALL=C.UTF-8
pids=()
finish() {
  local code=$?
  [ ${#pids[@]} -eq 0 ] || kill "${pids[@]}" 2>/dev/null
  wait
  [ "$code" -eq 0 ] || { tail -n 5 "$work"/*.log 2>/dev/null; }
  rm -rf "$work"
  exit "$code"
}
trap finish EXIT
fail() { echo "FAIL $*"; exit 1; }
# until_true SECONDS COMMAND...
until_true() {
  local end=$((SECONDS + $1))
  shift
  until "$@" >/dev/null 2>&1; do
    [ "$SECONDS" -lt "$end" ] || return 1
    sleep 0.2
  done
}

# 40 recordings: two folders with the same names, short ones and long ones, one that is damaged for good.
mkdir -p "$work"/in/{a,b}
make() { # NAME FRAMES SEED
  gst-launch-1.0 -q terrainscenesrc num-buffers="$2" seed="$3" ! video/x-raw,format=I420,width=96,height=64 ! x264enc \
    speed-preset=ultrafast threads=1 ! h264parse ! mp4mux ! filesink location="$work/in/$1" || fail "making $1"
}
for seed in 1 2 3 4; do make "recording-$seed.mp4" 60 "$seed"; done
for i in $(seq 20); do
  cp "$work/in/recording-$((i % 4 + 1)).mp4" "$work/in/a/drive-$i.mp4"
  cp "$work/in/recording-$(((i + 1) % 4 + 1)).mp4" "$work/in/b/drive-$i.mp4"
done
head -c 700 "$work/in/recording-1.mp4" >"$work/in/b/drive-7.mp4"
(cd "$work/in" && printf '%s\n' {a,b}/drive-{1..20}.mp4) >"$work/list.txt"
[ "$(wc -l <"$work/list.txt")" -eq 40 ] || fail "the list has not 40 inputs"
options=(--outputs json,csv)

# unsharded: once, and what all others are compared with. Summaries hold times.
cd "$work/in" || exit
terrainseg-process --quiet --output-dir "$work/whole" --inputs-from "$work/list.txt" "${options[@]}" >"$work/whole.log" 2>&1
[ $? -eq 1 ] || fail "the unsharded run does not say that one input is damaged"
contents() { (cd "$1" && find . -type f ! -path './manifests/*' | sort && find . -type f \( -name '*.jsonl' -o -name '*.csv' \) ! -path './manifests/*' -print0 | sort -z | xargs -0 sha256sum); }
contents "$work/whole" >"$work/whole.contents"
[ "$(grep -c '  .*\.csv$' "$work/whole.contents")" -eq 39 ] || fail "the unsharded run made not 39 tables"
compare() { # FOLDER WHAT
  contents "$1" >"$work/other.contents"
  diff "$work/whole.contents" "$work/other.contents" >"$work/diff.log" || { head "$work/diff.log"; fail "$2 gives other names or bytes"; }
  cat "$1"/manifests/shard-*.jsonl | terrainseg-process --check - --inputs-from "$work/list.txt" >"$work/check.log" 2>&1
  [ $? -eq 1 ] || { cat "$work/check.log"; fail "$2: --check does not name the damaged one alone"; }
  echo "ok   $2: names and bytes of the unsharded run"
}

# Slurm
host=$(hostname -s)
mkdir -p "$work"/slurm/{state,spool,run}
dd if=/dev/urandom bs=1 count=1024 of="$work/slurm/munge.key" status=none
chmod 700 "$work/slurm/run" && chmod 400 "$work/slurm/munge.key" && chmod 755 "$work/slurm"
munged --foreground --force --num-threads=2 --key-file="$work/slurm/munge.key" --socket="$work/slurm/munge.socket" \
  --pid-file="$work/slurm/munged.pid" --seed-file="$work/slurm/seed" --log-file="$work/munged.log" >>"$work/munged.log" 2>&1 &
pids+=($!)
ports=$(/usr/bin/python3 -c "import sys; sys.path.insert(0, '$top/tests'); from ports import free_port; print(free_port(), free_port())")
read -r control_port node_port <<<"$ports"
cat >"$work/slurm/slurm.conf" <<CONF
ClusterName=test
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=$control_port
SlurmdPort=$node_port
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket=$work/slurm/munge.socket
CredType=cred/munge
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
ProctrackType=proctrack/pgid
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
MpiDefault=none
ReturnToService=2
SchedulerParameters=sched_interval=2,batch_sched_delay=1,requeue_delay=1
MinJobAge=600
KillWait=2
StateSaveLocation=$work/slurm/state
SlurmdSpoolDir=$work/slurm/spool
SlurmctldPidFile=$work/slurm/run/slurmctld.pid
SlurmdPidFile=$work/slurm/run/slurmd.pid
NodeName=$host NodeAddr=127.0.0.1 CPUs=$(nproc) State=UNKNOWN
PartitionName=all Nodes=$host Default=YES MaxTime=INFINITE OverSubscribe=FORCE:4 State=UP
CONF
echo "CgroupPlugin=cgroup/v1" >"$work/slurm/cgroup.conf"
export SLURM_CONF=$work/slurm/slurm.conf
until_true 20 test -S "$work/slurm/munge.socket" || fail "munged does not start"
slurmctld -D -f "$SLURM_CONF" >"$work/slurmctld.log" 2>&1 &
pids+=($!)
slurmd -D -f "$SLURM_CONF" >"$work/slurmd.log" 2>&1 &
pids+=($!)
node_is() { [ "$(sinfo -h -o %T)" = "$1" ]; }
until_true 60 node_is idle || { sinfo; fail "the node does not come up"; }

# The first array works with a program that stops itself in the middle of its work, at a write to an unfinished file, and
# that has left its number: it waits for what the test does to it, however fast or slow the machine is. After SIGCONT it
# goes on as if nothing had been; the second array runs terrainseg-process as it is.
mkdir -p "$work/held" "$work/stopped"
cat >"$work/held/terrainseg-process" <<HELD
#!/bin/sh
# Written whole under its name: who sees it can read it.
echo \$\$ >"$work/stopped/.\$SLURM_ARRAY_TASK_ID"
mv "$work/stopped/.\$SLURM_ARRAY_TASK_ID" "$work/stopped/\$SLURM_ARRAY_TASK_ID"
FAULT=stop:9 LD_PRELOAD="$faults" exec "$build/src/tools/terrainseg-process" "\$@"
HELD
chmod 755 "$work/held/terrainseg-process"
submit() { sbatch --parsable --array=1-4 "$top/examples/fleet/slurm.sh" "$work/list.txt" "$work/slurm-out" "${options[@]}"; }
# is_stopped TASK: its program has stopped itself.
is_stopped() { [ -s "$work/stopped/$1" ] && grep -q '^State:.T' "/proc/$(cat "$work/stopped/$1")/status"; }
job=$(PATH=$work/held:$PATH submit) || fail "sbatch"
until_true 120 is_stopped 1 || { squeue; fail "task 1 does not run"; }
[ -n "$(find "$work/slurm-out" -name '*.part')" ] || fail "task 1 is not in the middle of its work"
kill -KILL "$(cat "$work/stopped/1")" || fail "task 1 cannot be killed"
until_true 120 is_stopped 2 || { squeue; fail "task 2 does not run"; }
rm "$work/stopped/2"
scontrol requeue "${job}_2" || fail "requeue"
# Slurm lets a job that was put back wait for two minutes, counted from its end: this one need not.
is_over() {
  local task
  for task in 2 3 4; do
    ! is_stopped "$task" || kill -CONT "$(cat "$work/stopped/$task")"
  done
  scontrol update "JobId=${job}_2" StartTime=now
  [ -z "$(squeue -h -t PD,R,CF,CG -j "$job")" ]
}
until_true 240 is_over || { squeue; fail "the array does not come to its end"; }
grep -q . "terrainseg-${job}_1.log" || fail "no log of the killed task"
! [ -s "$work/slurm-out/manifests/shard-1.jsonl" ] || fail "the killed task says that it is whole"
scontrol show job "${job}_2" | grep -q 'Restarts=1' || fail "task 2 was not put back into the queue"
echo "ok   a task was killed and one put back; the array is over"
# What an operator does: submit the array again. What is whole is skipped.
again=$(submit) && job=$again || fail "sbatch"
until_true 240 is_over || { squeue; fail "the second array does not come to its end"; }
compare "$work/slurm-out" "Slurm"

# GNU parallel
"$top/examples/fleet/parallel.sh" "$work/list.txt" "$work/parallel-out" 4 "${options[@]}" >"$work/parallel.log" 2>&1
[ $? -eq 1 ] || { cat "$work/parallel.log"; fail "parallel.sh does not tell the damaged input"; }
compare "$work/parallel-out" "GNU parallel"

# Kubernetes: no cluster here. The container's own command runs as four pods would; the manifest itself is looked at by the
# test `kubernetes`.
/usr/bin/python3 - "$top/examples/fleet/kubernetes.yaml" "$work" <<'PYTHON' || fail "the Kubernetes Job"
import os, subprocess, sys, yaml
job = yaml.safe_load(open(sys.argv[1]))
pod = job['spec']['template']['spec']
container = pod['containers'][0]
env = {each['name']: each['value'] for each in container['env']}
text = container['args'][0].replace('/data/out', sys.argv[2] + '/kubernetes-out').replace('/data/list.txt', sys.argv[2] + '/list.txt')
text = text.replace('--shard auto', '--shard auto --outputs json,csv')
for index in range(4):
    done = subprocess.run([*container['command'], text], env={**os.environ, **env, 'TERRAINSEG_SHARD_COUNT': '4', 'JOB_COMPLETION_INDEX': str(index)},
                          capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
PYTHON
compare "$work/kubernetes-out" "the Kubernetes container's command"
echo "ok"
