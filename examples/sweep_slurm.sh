#!/bin/bash
# A sweep as a Slurm array on a shared folder: each task runs the parts that are its own, and whoever writes the last one joins
# them to results.csv. Submit it again and it resumes.
#
#   sbatch --array=0-63 examples/sweep_slurm.sh sweep.toml results
#SBATCH --job-name=sweep
#SBATCH --cpus-per-task=4
#SBATCH --requeue
#SBATCH --time=01:00:00
set -euo pipefail
exec fmu sweep "$1" --out "$2" --part "$SLURM_ARRAY_TASK_ID/$SLURM_ARRAY_TASK_COUNT" --jobs "$SLURM_CPUS_PER_TASK"
