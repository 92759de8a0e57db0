"""Workers of a study: threads, processes, the user's executor, or a dask cluster.

Of an executor only `submit` is used, as `concurrent.futures.Executor` defines it.
"""

from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any, NamedTuple, Protocol, runtime_checkable

from hysim._frozen import check_count
from hysim._parallel import cores, processes, threads
from hysim.sweeps._chunks import Chunk, Outcome, Task, computed

_task_of_process: list[Task] = []  # the task of the study that this process was started for


@runtime_checkable
class _Submits(Protocol):
    def submit(self, function: Task, /, *arguments: Any) -> Future[Any]: ...


@runtime_checkable
class _DaskClient(Protocol):
    def get_executor(self) -> _Submits: ...

    def nthreads(self) -> dict[str, int]: ...


class Workers(NamedTuple):
    """A function that sends a chunk out, and the number of chunks that are computed at a time."""

    submit: Callable[[Chunk], Future[Outcome]]
    number: Callable[[], int]


@contextmanager
def workers_of(executor: Any, number: int | None, task: Task) -> Iterator[Workers]:
    """The workers that the argument `executor` of `sweep` stands for; own threads and processes end with the block."""
    if number is not None:
        check_count("workers", number)
    if executor in (None, "threads"):
        with threads(number or cores()) as pool:
            yield Workers(lambda chunk: pool.submit(computed, task, chunk), lambda: number or cores())
    elif executor == "processes":
        with processes(number or cores(), _begin, task) as pool:
            yield Workers(lambda chunk: pool.submit(_computed_here, chunk), lambda: number or cores())
    elif isinstance(executor, str):
        raise ValueError(f'executor must be "threads", "processes", an Executor or a dask client, got {executor!r}')
    elif isinstance(executor, _DaskClient):
        of_client = executor.get_executor()
        yield Workers(
            lambda chunk: of_client.submit(computed, task, chunk),
            lambda: number or max(1, sum(executor.nthreads().values())),
        )
    elif isinstance(executor, _Submits):
        is_pool = isinstance(executor, (ThreadPoolExecutor, ProcessPoolExecutor))
        size: int = vars(executor)["_max_workers"] if is_pool else cores()
        yield Workers(lambda chunk: executor.submit(computed, task, chunk), lambda: number or size)
    else:
        raise TypeError(f"executor must have the method submit of concurrent.futures.Executor, got {executor!r}")


def _begin(task: Task) -> None:
    _task_of_process[:] = [task]


def _computed_here(chunk: Chunk) -> Outcome:
    return computed(_task_of_process[0], chunk)
