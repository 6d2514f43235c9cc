#!/bin/bash
# A sweep as a Slurm array on a shared folder: each task runs its own parts, and the task that writes the last one joins
# them to results.csv. Submit it again to resume.
#
#   sbatch --array=0-63 examples/sweep_slurm.sh sweep.toml results
#SBATCH --job-name=sweep
#SBATCH --cpus-per-task=4
#SBATCH --requeue
#SBATCH --time=01:00:00
set -euo pipefail
exec fmu sweep "$1" --out "$2" --part "$SLURM_ARRAY_TASK_ID/$SLURM_ARRAY_TASK_COUNT" --jobs "$SLURM_CPUS_PER_TASK"
