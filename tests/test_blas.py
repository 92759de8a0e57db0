"""Fits solve small problems on one thread of BLAS, and leave the number of threads as they found it."""

import os
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from strategies import with_peak_memory
from threadpoolctl import threadpool_info, threadpool_limits

import hysim as hs
from hysim._basics.blas import _controller, one_blas_thread
from hysim._basics.parallel import processes

U = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=10)
RECORD = hs.Record(u=U, y=hs.Play(threshold=0.3).response(U))


def threads():
    """Number of threads of each BLAS that is loaded."""
    return {each["filepath"]: each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"}


@pytest.fixture
def two_threads():
    _controller.cache_clear()  # a test before this one may have loaded a BLAS that no search uses
    with one_blas_thread():  # loads all of them
        pass
    with threadpool_limits(2, user_api="blas"):
        before = threads()
        if set(before.values()) != {2}:
            pytest.skip("this BLAS takes no two threads")
        yield before


def test_one_thread_inside_and_as_before_after_the_last_call(two_threads):
    with one_blas_thread():
        with one_blas_thread():
            assert set(threads().values()) == {1}
        assert set(threads().values()) == {1}
    assert threads() == two_threads
    with pytest.raises(ZeroDivisionError), one_blas_thread():
        raise ZeroDivisionError
    assert threads() == two_threads


@pytest.mark.parametrize("call", [lambda: hs.identify(hs.Play, RECORD), lambda: hs.compare({"play": hs.Play}, RECORD)])
def test_calls_from_several_threads_leave_it_too(two_threads, call):
    seen = []

    def look(done, total):
        seen.extend(threads().values())

    hs.identify(hs.Play, RECORD, progress=look)
    assert set(seen) == {1}
    with ThreadPoolExecutor(4) as pool:
        list(pool.map(lambda _: call(), range(12)))
    assert threads() == two_threads


def threads_before_and_after_a_product():
    """Number of threads of this process before and after it has limited its BLAS and used it."""
    before = len(os.listdir("/proc/self/task"))
    with one_blas_thread():
        np.ones((200, 200)) @ np.ones((200, 200))
    return before, len(os.listdir("/proc/self/task"))


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="processes are forked, and /proc is, on Linux alone")
def test_a_forked_process_starts_no_threads_of_blas(two_threads):
    with processes(1, int) as pool:
        before, after = pool.submit(threads_before_and_after_a_product).result()
    assert after == before
    assert threads() == two_threads


def test_a_search_on_a_small_record_keeps_its_arrays_small():
    u = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=100)
    record = hs.Record(u=u, y=hs.BoucWen(beta=0.6, gamma=0.1).response(u))

    held = {"A": 1.0, "n": 1.0, "gain": 1.0, "feedthrough": 0.0, "offset": 0.0, "z0": 0.0}

    def fit():
        return hs.identify(hs.BoucWen(n=1.0), record, free=("beta", "gamma"), fixed=held)

    fit()
    _, peak = with_peak_memory(fit)
    assert peak < 6e6  # from some ten megabytes on a C library may return them to the system after each evaluation
