#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# One Slurm array job over a list of recordings: sbatch --array=1-8 examples/fleet/slurm.sh LIST OUT [OPTION...]
#   LIST       one input per line, on a file system that all nodes see; OUT: the folder for the results, there too
#   OPTION...  further options of terrainseg-process, such as --outputs masks,json
# The task number and the size of the array select the shard (--shard auto). A task that is killed or finds a full disk is
# requeued; complete inputs are not processed again.
#SBATCH --job-name=terrainseg
#SBATCH --cpus-per-task=1
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output=terrainseg-%A_%a.log
set -uo pipefail
[ $# -ge 2 ] || { sed -n '3,5s/^# //p' "$0"; exit 2; }
list=$1 out=$2
shift 2
mkdir -p "$out/manifests"
terrainseg-process --quiet --resume --output-dir "$out" --inputs-from "$list" --shard auto \
  --manifest "$out/manifests/shard-$SLURM_ARRAY_TASK_ID.jsonl" "$@"
code=$?
# 75: trying again may help. Three times at most, so that a disk that stays full does not keep the queue busy.
if [ "$code" -eq 75 ] && [ "${SLURM_RESTART_COUNT:-0}" -lt 3 ]; then
  scontrol requeue "${SLURM_ARRAY_JOB_ID}_$SLURM_ARRAY_TASK_ID"
fi
exit "$code"
