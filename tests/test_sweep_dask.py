"""A dask cluster of processes on the loopback: a worker that is killed costs nothing but time."""

import os
import signal
import subprocess
import sys
from contextlib import ExitStack, suppress

import numpy as np
import pytest
from test_sweep import bits

import hysim as hs

pytestmark = [
    pytest.mark.extra("distributed"),
    pytest.mark.filterwarnings("default"),  # what a cluster that loses a worker warns of is not ours
]

N_TASKS = 40


def slow(k, seed):
    """Some milliseconds."""
    rng = np.random.default_rng(seed)
    return {"largest": max(rng.standard_normal(20_000).cumsum().max() for _ in range(20)) + k}


def started(*arguments):
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([os.path.dirname(__file__), *sys.path]),
        "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "5",
    }
    return subprocess.Popen(
        [sys.executable, "-m", "distributed.cli." + arguments[0], *arguments[1:]],
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )


@pytest.fixture(scope="module")
def serial():
    return hs.sweep(slow, {"k": range(N_TASKS)}, workers=1)


@pytest.fixture(scope="module")
def client(tmp_path_factory):
    from distributed import Client

    folder = tmp_path_factory.mktemp("dask")
    file = str(folder / "scheduler.json")
    common = ["--scheduler-file", file, "--no-dashboard"]
    worker = ["dask_worker", *common, "--nthreads", "1", "--local-directory", str(folder), "--host", "127.0.0.1"]
    with ExitStack() as stack:
        for arguments in (["dask_scheduler", *common, "--port", "0", "--host", "127.0.0.1"], worker, worker):
            process = started(*arguments)
            stack.callback(process.wait)
            stack.callback(kill_group, process.pid)
        yield stack.enter_context(Client(scheduler_file=file, timeout=60))


def kill_group(leader):
    with suppress(ProcessLookupError):
        os.killpg(leader, signal.SIGKILL)


def process_of(dask_worker=None):
    """Of a worker, and of its nanny."""
    return os.getpid(), os.getppid()


@pytest.mark.parametrize("victim", ["worker", "nanny"])
def test_a_killed_worker_costs_no_task_and_no_bit(client, serial, victim, tmp_path):
    client.wait_for_workers(2, timeout=60)
    worker, nanny = next(iter(client.run(process_of).values()))
    doomed = [{"worker": worker, "nanny": nanny}[victim]]

    def kill(done, total):
        if done >= N_TASKS // 6 and doomed:
            os.kill(doomed.pop(), signal.SIGKILL)

    result = hs.sweep(slow, {"k": range(N_TASKS)}, executor=client, store=tmp_path / "study.sqlite", progress=kill)
    assert not doomed
    assert bits(result) == bits(serial) == bits(hs.load_sweep(tmp_path / "study.sqlite"))
