"""A study on the processes of an MPI job: mpiexec -n 32 python -m mpi4py.futures mpi.py."""

from mpi4py.futures import MPIPoolExecutor
from width import width  # importable in all processes

import hysim as hs

if __name__ == "__main__":
    with MPIPoolExecutor() as pool:
        space = {"beta": [0.2, 0.5], "n": [1.0, 1.5, 2.0]}
        hs.sweep(width, space, executor=pool, workers=pool.num_workers, store="rows.sqlite")
