#!/bin/bash
# A campaign as an array of Slurm: sbatch --array=0-63 campaign/cluster/slurm.sh FILE DIR
# FILE, DIR and this checkout are on a disk that all nodes share; the programs are built before, by scripts/campaign plan FILE.
#SBATCH --job-name=airbench-campaign
#SBATCH --cpus-per-task=4
#SBATCH --mem-per-cpu=500M
#SBATCH --time=04:00:00
#SBATCH --requeue
set -euo pipefail
root=${AIRBENCH_ROOT:-$SLURM_SUBMIT_DIR}

# Shards count from 0, and so does the array; SLURM_ARRAY_TASK_ID tells which. A start that was cut off goes on where it was.
exec "$root/target/release/campaign" run "$1" --shipped "$root/controller" --out "$2" \
    --shard "$SLURM_ARRAY_TASK_COUNT" --jobs "${SLURM_CPUS_PER_TASK:-1}"
# Afterwards, on any node: target/release/campaign merge FILE DIR
