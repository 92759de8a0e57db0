"""Work cut into chunks over threads.

Kernels release the interpreter lock, so that a pool of threads keeps all cores busy. How the work is
cut does not change a result: every item is computed by itself.
"""

import itertools
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

Progress = Callable[[int, int], None]
"""Called as ``progress(done, total)``."""


def cores() -> int:
    """Number of processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def in_chunks(work: Callable[[int, int], None], n_items: int, *, workers: int | None = None, minimum: int = 64) -> None:
    """Call `work(start, stop)` so that the calls cover `range(n_items)` once.

    Parameters
    ----------
    work : callable
        Computes the items from `start` to `stop - 1`, and writes nothing else.
    n_items : int
        Number of items.
    workers : int, optional
        Number of threads; by default one for each core.
    minimum : int
        Fewest items that are worth a thread.
    """
    if workers is not None and workers < 1:
        raise ValueError(f"workers must be at least 1, got {workers}")
    n_chunks = max(1, min(workers or cores(), n_items // minimum))
    edges = [n_items * k // n_chunks for k in range(n_chunks + 1)]
    own, *others = itertools.pairwise(edges)
    if not others:
        work(*own)
        return
    with ThreadPoolExecutor(len(others)) as pool:
        running = [pool.submit(work, *chunk) for chunk in others]
        work(*own)
        for chunk in running:
            chunk.result()
