"""A study on workers that dask-jobqueue asks a SLURM cluster for: python jobqueue.py, on the login node."""

from dask_jobqueue import SLURMCluster
from distributed import Client
from width import width  # importable on the workers, too

import hysim as hs

cluster = SLURMCluster(cores=8, processes=8, memory="16GB", walltime="01:00:00")
cluster.adapt(minimum=1, maximum=20)  # jobs of 8 workers
with Client(cluster) as client:
    hs.sweep(width, {"beta": [0.2, 0.5], "n": [1.0, 1.5, 2.0]}, executor=client, store="rows.sqlite")
