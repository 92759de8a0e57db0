"""Linear algebra on one thread, where many small problems are solved.

A BLAS that divides a matrix of some hundred rows between threads loses more time by waiting than it gains: a fit of a
law to 10 000 samples takes up to five times as long. Searches keep the cores busy with sets of parameters instead.
"""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

from threadpoolctl import ThreadpoolController

_lock = threading.Lock()
_inside = 0  # calls that have begun and not ended, in all threads
_limiter = None


@cache
def _controller() -> ThreadpoolController:
    import scipy.linalg  # noqa: F401  brings a BLAS of its own, which must be loaded to be found

    return ThreadpoolController()


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Limit BLAS to one thread until the last of the calls that are inside has ended."""
    global _inside, _limiter
    with _lock:
        if _inside == 0:
            _limiter = _controller().limit(limits=1, user_api="blas")
        _inside += 1
    try:
        yield
    finally:
        with _lock:
            _inside -= 1
            if _inside == 0 and _limiter is not None:
                _limiter.restore_original_limits()
                _limiter = None
