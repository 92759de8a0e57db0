#!/bin/bash
# A study in shards, one for each job of an array: sbatch slurm_array.sh. No job knows of another.
#SBATCH --job-name=hysim-study
#SBATCH --array=0-99
#SBATCH --ntasks=1
#SBATCH --cpus-per-task=4
#SBATCH --time=01:00:00
#SBATCH --requeue

# Five minutes before the time is over nothing is begun any more. Exit code 3: the shard is not finished; the job goes
# back into the queue, and goes on with the rows that its shard has.
status=0
hysim sweep study.toml --out rows.sqlite --shard auto --workers "${SLURM_CPUS_PER_TASK:-1}" --time-limit 3300 || status=$?
if [ "$status" -eq 3 ]; then
  scontrol requeue "${SLURM_ARRAY_JOB_ID}_${SLURM_ARRAY_TASK_ID}"
fi
exit "$status"

# When all jobs have ended: hysim sweep study.toml --out rows.sqlite --merge --csv rows.csv
