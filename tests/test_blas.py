"""Fits solve small problems on one thread of BLAS, and leave the number of threads as they found it."""

from concurrent.futures import ThreadPoolExecutor

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import hysim as hs
from hysim._blas import one_blas_thread

U = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=40)
RECORD = hs.Record(u=U, y=hs.Play(threshold=0.3).response(U))


def threads():
    """Number of threads of each BLAS that is loaded."""
    return {each["filepath"]: each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"}


@pytest.fixture
def two_threads():
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
