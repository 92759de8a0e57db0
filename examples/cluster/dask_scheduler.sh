#!/bin/bash
# A study on a dask cluster that lasts as long as the job: one scheduler, the other tasks are workers.
#SBATCH --job-name=hysim-dask
#SBATCH --ntasks=9
#SBATCH --cpus-per-task=1
#SBATCH --time=01:00:00

dask scheduler --scheduler-file scheduler.json &
scheduler=$!
workers=
for _ in $(seq "$((${SLURM_NTASKS:-9} - 1))"); do
  ${SLURM_JOB_ID:+srun --exact --ntasks=1} dask worker --nthreads 1 --scheduler-file scheduler.json &
  workers="$workers $!"
done
until [ -s scheduler.json ]; do sleep 1; done

status=0
hysim sweep study.toml --out rows.sqlite --resume --dask scheduler.json || status=$?
# shellcheck disable=SC2086  # numbers of processes
kill $workers "$scheduler"
rm -f scheduler.json
exit "$status"
