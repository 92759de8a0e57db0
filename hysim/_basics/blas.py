"""Linear algebra on one thread, where many small problems are solved.

A BLAS that divides a matrix of some hundred rows between threads loses more time by waiting than it gains: a fit of a
law to 10 000 samples takes up to five times as long. Searches divide sets of parameters between the cores instead.
"""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

from threadpoolctl import ThreadpoolController

_lock = threading.Lock()
_running = 0  # calls that have begun and not ended, in all threads
_limiter = None


@cache
def _controller() -> ThreadpoolController:
    import scipy.linalg  # noqa: F401  brings a BLAS of its own, which must be loaded to be found

    return ThreadpoolController()


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Limit BLAS to one thread until the last of the running calls, in any thread, has ended."""
    global _running, _limiter
    with _lock:
        if _running == 0:
            _limiter = _controller().limit(limits=1, user_api="blas")
        _running += 1
    try:
        yield
    finally:
        with _lock:
            _running -= 1
            if _running == 0 and _limiter is not None:
                _limiter.restore_original_limits()
                _limiter = None
