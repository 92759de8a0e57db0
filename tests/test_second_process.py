"""Work in a second process comes back as if it had been done here, its exceptions too."""

import os
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from strategies import assert_refused

from hysim._basics import parallel as _parallel
from hysim._basics.parallel import forked

FORKS = sys.platform.startswith("linux")


def square(values):
    return np.asarray(values) ** 2


def whose():
    return os.getpid()


def fail(message):
    raise ValueError(message)


def add(a, *, b):
    return a + b


@pytest.fixture(params=["forked", "in place"])
def executor(request, monkeypatch):
    monkeypatch.setattr(_parallel, "cores", lambda: 2 if request.param == "forked" else 1)
    return forked


def test_results_come_back(executor):
    values = np.linspace(0.0, 1.0, 7)
    with executor(1) as pool:
        futures = [pool.submit(square, values * k) for k in range(4)]
        named = pool.submit(add, 1, b=2)
        for k, future in enumerate(futures):
            assert np.array_equal(future.result(), (values * k) ** 2)
        assert named.result() == 3


def test_exceptions_come_back_when_the_result_is_asked_for(executor):
    with executor(1) as pool:
        failed, fine = pool.submit(fail, "what was wrong"), pool.submit(add, 1, b=1)
        assert_refused(r"^what was wrong$", failed.result)
        assert fine.result() == 2
        assert isinstance(failed.exception(), ValueError)


def test_an_error_of_ones_own_passes_through(executor):
    def work():
        with executor(1) as pool:
            pool.submit(add, 1, b=1)
            raise KeyError("mine")

    assert_refused("mine", work, error=KeyError)


def test_nothing_can_be_submitted_to_a_pool_that_is_left(monkeypatch):
    monkeypatch.setattr(_parallel, "cores", lambda: 2)
    with forked(1) as pool:
        pool.submit(add, 1, b=1).result()
    if FORKS:
        assert_refused("after shutdown", pool.submit, add, 1, error=RuntimeError, b=1)


@pytest.mark.skipif(not FORKS, reason="elsewhere the work is done in place")
def test_with_two_cores_the_work_is_done_elsewhere_and_with_one_here(monkeypatch):
    found = {}
    for cores in (1, 2):
        monkeypatch.setattr(_parallel, "cores", lambda cores=cores: cores)
        with forked(1) as pool:
            found[cores] = pool.submit(whose).result()
    assert found[1] == os.getpid()
    assert found[2] != os.getpid()


def test_systems_that_do_not_fork_work_in_place(monkeypatch):
    monkeypatch.setattr(_parallel, "cores", lambda: 8)
    monkeypatch.setattr(_parallel.sys, "platform", "darwin")
    with forked(1) as pool:
        assert pool.submit(whose).result() == os.getpid()


def test_threads_of_others_work_in_place(monkeypatch):
    """They may hold locks, which nobody would free in a forked process."""
    monkeypatch.setattr(_parallel, "cores", lambda: 2)

    def elsewhere():
        with forked(2) as pool:
            return pool.submit(whose).result()

    with ThreadPoolExecutor(1) as threads:
        assert threads.submit(elsewhere).result() == os.getpid()
    assert (elsewhere() != os.getpid()) == FORKS


def test_there_is_at_least_one_core():
    assert _parallel.cores() >= 1
