"""A study on disk: an SQLite database with one row for each finished task, and arrays beside it.

    study      what the study is: its identity, its parameters, the axes of a grid, the layout of a row
    results    task, seed, seconds, error, shard; then the parameters, then the outputs that are numbers

A row is there or not: rows are written in transactions, and the arrays that they name are in files, one for each
transaction, which are whole before it begins. Columns have no declared type, which would cost zeros their sign; an
output that is nan is NULL in a row without an error. From one transaction to the next the writer holds SQLite's
lock for writing, so that nobody else writes, and everybody may read.
"""

import errno
import json
import os
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from hysim._atomic import whole
from hysim._frozen import FloatArray
from hysim.sweeps._chunks import Group, Layout, Outcome
from hysim.sweeps._space import Column, Space

OnChange = Literal["error", "keep", "restart"]
ON_CHANGE = ("error", "keep", "restart")

_FOR_A_WRITER, _FOR_A_COMMIT, _FOR_READERS = 0.25, 10.0, 60.0  # seconds to wait for another's lock
_OWN_COLUMNS = ("task", "seed", "seconds", "error", "shard")
_TROUBLE = {
    sqlite3.SQLITE_BUSY: (errno.EAGAIN, "the store is locked: another process is writing to it"),
    sqlite3.SQLITE_LOCKED: (errno.EAGAIN, "the store is locked: another process is writing to it"),
    sqlite3.SQLITE_FULL: (errno.ENOSPC, "the disk is full; every row that was reported is kept"),
    sqlite3.SQLITE_READONLY: (errno.EACCES, "the store is read-only"),
    sqlite3.SQLITE_CANTOPEN: (errno.EACCES, "the store cannot be opened or made there"),
}


class Store:
    """An open store; see `opened`."""

    def __init__(self, path: Path, database: sqlite3.Connection) -> None:
        self.path, self._database = path, database
        self._folder = path.with_name(f"{path.name}.arrays")

    def begin(self, identity: Mapping[str, str], space: Space, on_change: OnChange) -> None:
        """Make the store that of this study, or refuse it."""
        self._database.execute("BEGIN IMMEDIATE")
        before = self._study()
        if before is not None and _changes(before["identity"], identity):
            before = self._after_change(before["identity"], identity, on_change)
        if before is None:
            self._create(identity, space)
        self._remember("identity", dict(identity))
        self._remove_shards_without_rows()
        self._commit()

    def space(self) -> Space:
        """Parameters and axes of the rows that are there."""
        study = self._known()
        axes = study["axes"] and {name: _as_column(values, study["kinds"][name]) for name, values in study["axes"]}
        columns = {
            name: _as_column(self._column(column), study["kinds"][name]) for name, column in study["parameters"].items()
        }
        return Space(columns, axes)

    @property
    def n_tasks(self) -> int:
        """Number of tasks that the study has, finished or not."""
        return int(self._known()["n_tasks"])

    @property
    def seed(self) -> int:
        """Of the study."""
        return int(self._known()["identity"]["seed"])

    def layout(self) -> Layout | None:
        """Names and shapes of a row, None before the first task that succeeds."""
        layout = self._known().get("layout")
        return layout and tuple((name, tuple(shape)) for name, shape, _ in layout)

    def finished(self) -> Outcome:
        """All rows that are there, in the order of the tasks."""
        places = np.array(self._column("task"), dtype=np.int64)
        messages = self._column("error")
        failed = {place: text for place, text in zip(places.tolist(), messages, strict=True) if text is not None}
        seconds = np.array(self._column("seconds"), dtype=float)
        layout = self._known().get("layout") or ()
        good = np.array([text is None for text in messages], dtype=bool)
        arrays = self._arrays(places[good]) if any(shape for _, shape, _ in layout) else {}
        columns = [
            arrays[name] if shape else np.array(self._column(column), dtype=float)[good]
            for name, shape, column in layout
        ]
        group = Group(tuple((name, tuple(shape)) for name, shape, _ in layout), places[good], tuple(columns))
        return Outcome(places, (group,) if columns else (), failed, seconds)

    def commit(self, outcomes: list[Outcome], layout: Layout | None, space: Space, seeds: Column) -> None:
        """Write the rows of finished chunks, all or none of them; what was written before may be written again."""
        if not self._database.in_transaction:  # after an interrupt
            self._database.execute("BEGIN IMMEDIATE")
        try:
            self._write(outcomes, layout, space, seeds)
            self._commit()
        except BaseException:
            if self._database.in_transaction:
                self._database.execute("ROLLBACK")
            raise

    def _write(self, outcomes: list[Outcome], layout: Layout | None, space: Space, seeds: Column) -> None:
        if layout and not self._known().get("layout"):
            self._lay_out(layout)
        names = [*_OWN_COLUMNS, *self._known()["parameters"].values()]
        outputs = [column for _, shape, column in self._known().get("layout") or () if not shape]
        shard = self._write_shard(outcomes)
        for outcome in outcomes:
            for group in outcome.groups:
                numbers = [column for (_, shape), column in zip(group.layout, group.columns, strict=True) if not shape]
                self._insert(outcome, group.places, shard, (space, seeds), [*names, *outputs], numbers)
            self._insert(outcome, np.array([*outcome.errors], dtype=np.int64), None, (space, seeds), names, [])

    def _insert(
        self,
        outcome: Outcome,
        places: npt.NDArray[np.int64],
        shard: str | None,
        of_tasks: tuple[Space, Column],
        names: list[str],
        outputs: list[FloatArray],
    ) -> None:
        space, seeds = of_tasks
        seconds = dict(zip(outcome.places.tolist(), outcome.seconds.tolist(), strict=True))
        keys = places.tolist()
        columns = [
            keys,
            seeds[places].tolist(),
            [seconds[place] for place in keys],
            [outcome.errors.get(place) for place in keys],
            [shard] * len(keys),
            *(column[places].tolist() for column in space.columns.values()),
            *(column.tolist() for column in outputs),
        ]
        self._database.executemany(
            f"INSERT OR REPLACE INTO results ({', '.join(names)}) VALUES ({', '.join('?' * len(names))})",
            zip(*columns, strict=True),
        )

    def _study(self) -> dict[str, Any] | None:
        tables = [name for (name,) in self._database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
        if not tables:
            return None
        if {"study", "results"} - {*tables}:
            raise ValueError(f"{self.path} is a database, but not a store of hysim: it has other tables")
        return {name: json.loads(value) for name, value in self._database.execute("SELECT name, value FROM study")}

    def _known(self) -> dict[str, Any]:
        study = self._study()
        if study is None:
            raise ValueError(f"{self.path} is not a store of hysim: it is empty")
        return study

    def _after_change(
        self, before: Mapping[str, str], now: Mapping[str, str], on_change: OnChange
    ) -> dict[str, Any] | None:
        changes = _changes(before, now)
        if on_change == "restart":
            self._database.execute("DROP TABLE results")
            self._database.execute("DROP TABLE study")
            return None
        if on_change == "keep" and not {"space", "seed"} & changes.keys():
            return self._known()
        mend = 'on_change="restart" begins anew'
        if not {"space", "seed"} & changes.keys():
            mend = f'on_change="keep" keeps the finished rows and goes on, {mend}'
        raise ValueError(
            f"{self.path} holds another study: {'; '.join(changes.values())}. Give another store, or say what to do: "
            f"{mend}"
        )

    def _create(self, identity: Mapping[str, str], space: Space) -> None:
        parameters = _identifiers(space.columns, _OWN_COLUMNS)
        self._database.execute("CREATE TABLE study (name TEXT PRIMARY KEY, value TEXT)")
        self._database.execute(
            "CREATE TABLE results (task INTEGER PRIMARY KEY, seed INTEGER, seconds, error TEXT, shard TEXT, "
            f"{', '.join(parameters.values())})"
        )
        self._remember("n_tasks", space.n_tasks)
        self._remember("parameters", parameters)
        self._remember("kinds", {name: column.dtype.kind for name, column in space.columns.items()})
        self._remember("axes", space.axes and [[name, values.tolist()] for name, values in space.axes.items()])

    def _lay_out(self, layout: Layout) -> None:
        taken = (*_OWN_COLUMNS, *(column.strip('"') for column in self._known()["parameters"].values()))
        columns = _identifiers([name for name, _ in layout], taken)
        for name, shape in layout:
            if not shape:
                self._database.execute(f"ALTER TABLE results ADD COLUMN {columns[name]}")
        self._remember("layout", [[name, shape, columns[name]] for name, shape in layout])

    def _remember(self, name: str, value: Any) -> None:
        self._database.execute("INSERT OR REPLACE INTO study VALUES (?, ?)", (name, json.dumps(value)))

    def _column(self, name: str) -> list[Any]:
        return [value for (value,) in self._database.execute(f"SELECT {name} FROM results ORDER BY task")]

    def _commit(self) -> None:
        self._database.execute("COMMIT")
        self._database.execute(f"PRAGMA busy_timeout = {1000 * _FOR_READERS:.0f}")
        self._database.execute("BEGIN IMMEDIATE")

    def _write_shard(self, outcomes: list[Outcome]) -> str | None:
        groups = [group for outcome in outcomes for group in outcome.groups if any(shape for _, shape in group.layout)]
        if not groups:
            return None
        arrays = {
            f"output_{name}": np.concatenate([group.columns[k] for group in groups])
            for k, (name, shape) in enumerate(groups[0].layout)
            if shape
        }
        places = np.concatenate([group.places for group in groups])
        name = f"{places.min():09d}.npz"
        self._folder.mkdir(exist_ok=True)
        with whole(self._folder / name, "xb") as file:
            np.savez(file, task=places, **arrays)  # type: ignore[arg-type]
            file.flush()
            os.fsync(file.fileno())
        return name

    def _arrays(self, places: npt.NDArray[np.int64]) -> dict[str, FloatArray]:
        """Arrays of the tasks at these places, read from the shards that hold them."""
        layout = self._known()["layout"]
        arrays = {name: np.empty((places.size, *shape)) for name, shape, _ in layout if shape}
        shards = sorted({name for name in self._column("shard") if name})
        for shard in shards:
            with np.load(self._folder / shard, allow_pickle=False) as file:
                tasks = file["task"]
                rows = np.searchsorted(places, tasks)
                for name, array in arrays.items():
                    array[rows] = file[f"output_{name}"]
        return arrays

    def _remove_shards_without_rows(self) -> None:
        """Files that were written before a transaction that never came."""
        if self._folder.is_dir():
            named = {*self._column("shard")}
            for path in self._folder.iterdir():
                if ".npz" in path.name and path.name not in named:
                    path.unlink()


@contextmanager
def opened(path: str | Path, *, to_read: bool = False) -> Iterator[Store]:
    """The store in a file, which is made if it is missing and to be written; SQLite's errors become built-in ones.

    Raises
    ------
    OSError
        If it cannot be opened, read or written, with the reason.
    ValueError
        If the file is something else.
    """
    path = Path(path)
    if to_read and not path.is_file():
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(path))
    with _built_in_errors(path):
        database = _connected(path, "rw" if to_read else "rwc")
        try:
            if to_read:
                database.execute("BEGIN")  # everything that is read is of one moment
            yield Store(path, database)
        finally:
            database.close()  # what is not committed is rolled back


def _connected(path: Path, mode: str) -> sqlite3.Connection:
    """A connection; also a reader may write, because what a killed writer left half done is first taken back."""
    timeout = _FOR_A_WRITER if mode == "rwc" else _FOR_A_COMMIT
    return sqlite3.connect(f"{path.resolve().as_uri()}?mode={mode}", uri=True, timeout=timeout, isolation_level=None)


@contextmanager
def _built_in_errors(path: Path) -> Iterator[None]:
    try:
        yield
    except sqlite3.DatabaseError as error:
        code = getattr(error, "sqlite_errorcode", 0) & 0xFF
        if code in (sqlite3.SQLITE_NOTADB, sqlite3.SQLITE_CORRUPT):
            raise ValueError(f"{path} is not a store of hysim: {error}") from error
        number, message = _TROUBLE.get(code, (errno.EIO, f"the store failed: {error}"))
        raise OSError(number, message, str(path)) from error


def _changes(before: Mapping[str, str], now: Mapping[str, str]) -> dict[str, str]:
    """What differs, in words."""
    words = {
        name: f"the {name} was {before.get(name)} and is {value}"
        for name, value in now.items()
        if before.get(name) != value
    }
    if "task" in words:
        words["task"] = "the task's source or what is bound to it has changed"
    return words


def _identifiers(names: Any, taken: tuple[str, ...]) -> dict[str, str]:
    """Names of columns for SQL, which does not tell A from a."""
    used, identifiers = {name.lower() for name in taken}, {}
    for name in names:
        column, k = name, 1
        while column.lower() in used:
            k += 1
            column = f"{name}_{k}"
        used.add(column.lower())
        identifiers[name] = '"' + column.replace('"', '""') + '"'
    return identifiers


def _as_column(values: list[Any], kind: str) -> Column:
    return np.array(values, dtype={"f": np.float64, "i": np.int64, "b": bool, "U": str}[kind])
