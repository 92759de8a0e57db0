"""Searches that are asked for several times within one call of `identify`, `compare` or `select`, done once.

The best law of the admissible region is compared with the optimum, and often returned in its place. A family that
contains a simpler one begins its search with the optima of that one (`Problem.simpler`), which several families may
contain, and which is often compared itself. The first that needs a search does it; the others wait for what it finds.
"""

import hashlib
import threading
from collections.abc import Callable, Hashable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, TypeVar

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim._basics.parallel import awaited
from hysim.identification._problem import Problem

T = TypeVar("T")


_known: ContextVar[dict[Hashable, Future[Any]] | None] = ContextVar("searches that are known", default=None)
_lock = threading.Lock()


@contextmanager
def sharing() -> Iterator[None]:
    """Within the block `once` searches a problem once, in threads that `map_on_threads` begins there too."""
    token = _known.set({} if (known := _known.get()) is None else known)
    try:
        yield
    finally:
        _known.reset(token)


def once(problem: Problem, seed: int, search: Callable[[], T]) -> T:
    """The result of `search`, a function of the problem and the seed; one with a budget or a start is not shared."""
    known = _known.get()
    if known is None or problem.budget is not None or problem.ends is not None or problem.stage is not None:
        return search()
    key = (problem.family, _contents(problem), seed)
    try:
        hash(key)
    except TypeError:  # a family of the user's, with a list among its fields
        return search()
    with _lock:
        is_first = key not in known
        result: Future[T] = known.setdefault(key, Future())
    if is_first:
        try:
            result.set_result(search())
        except BaseException as error:
            result.set_exception(error)
            raise
    return awaited(result)


def _contents(problem: Problem) -> Hashable:
    """The freedom of a problem's family, and a digest of its records."""
    space, digest = problem.space, hashlib.blake2b()
    arrays: list[FloatArray | None] = [space.lower, space.upper, space.starts]
    for part in problem.parts:
        before = None if part.before is None else part.before.u
        arrays += [part.record.u, part.record.y, part.record.t, part.weights, before]
        arrays += [np.asarray(values) for _, values in sorted(part.record.channels.items())]
    for values in arrays:
        digest.update(b"none" if values is None else repr(values.shape).encode() + values.tobytes())
    freedom = (space.coordinates, space.names, space.linear, space.screened)
    return digest.digest(), freedom, tuple(sorted(space.held.items())), tuple(sorted(space.bounds.items()))
