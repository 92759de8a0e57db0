"""A study on disk: an SQLite database with one row for each finished task.

    study      what the study is: its identity, its parameters, the axes of a grid, the layout of a row
    results    task, seed, seconds, error; then the parameters, then the outputs

Rows are written in transactions. Arrays are blobs of float64, little-endian. Columns have no declared type, since zeros
would lose their sign; nan is NULL in a row without an error. Between transactions the writer keeps SQLite's lock for
writing: others may read, not write. Version 0.2 wrote arrays to files in a folder beside the store; these can be read.

The facts of a study are checked when they are read from a store:

    identity     name to text, which must be equal for two studies to be the same
    n_tasks      number of tasks
    parameters   name to column of the table of results
    kinds        name to kind of its values, as NumPy has it
    axes         names and values of the axes of a grid, or null
    layout       names, shapes and columns of the outputs, once a task has succeeded
    shards       what the names of the files with arrays begin with, if version 0.2 wrote them
"""

import errno
import json
import math
import os
import re
import reprlib
import sqlite3
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from itertools import chain, count
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeVar

import numpy as np

from hysim.sweeps._chunks import OWN_NAMES, Column, Layout, Rows, Space, Table

T = TypeVar("T")

_KINDS: dict[str, Any] = {"f": np.float64, "i": np.int64, "b": np.bool_, "U": np.str_}


class Output(NamedTuple):
    """Name, shape and column of an output."""

    name: str
    shape: Sequence[int]
    column: str


class Study(NamedTuple):
    """The facts of a study; see the module."""

    identity: Mapping[str, str]
    n_tasks: int
    parameters: Mapping[str, str]
    kinds: Mapping[str, str]
    axes: Sequence[tuple[str, list[Any]]] | None
    layout: Sequence[Output] = ()
    shards: str = ""

    @property
    def shapes(self) -> Layout:
        return {output.name: tuple(output.shape) for output in self.layout}


def study_of(rows: Mapping[str, Any]) -> Study:
    """The study in the rows of a store; some error if they are damaged."""
    facts = {name: json.loads(text) for name, text in rows.items()}
    axes = None if facts["axes"] is None else [(_of(str, name), _of(list, values)) for name, values in facts["axes"]]
    layout = [Output(_of(str, n), [*map(_size, shape)], _of(str, c)) for n, shape, c in facts.get("layout", ())]
    texts = {name: _texts(facts[name]) for name in ("identity", "parameters", "kinds")}
    shards = _of(str, facts.get("shards", ""))
    study = Study(**texts, n_tasks=_size(facts["n_tasks"]), axes=axes, layout=layout, shards=shards)
    is_sound = (
        (layout or "layout" not in facts)
        and (study.parameters and study.parameters.keys() == study.kinds.keys())
        and (_KINDS.keys() >= {*study.kinds.values()} and int(study.identity["seed"]) >= 0)
        and (axes is None or [name for name, _ in axes] == [*study.parameters])
        and (axes is None or math.prod(len(values) for _, values in axes) == study.n_tasks)
        and re.fullmatch("([0-9a-f]{16})?", study.shards)
    )
    if not is_sound:
        raise ValueError("the facts of its study contradict each other")
    return study


@contextmanager
def damage_named(path: str | Path) -> Iterator[None]:
    """Turn the errors of damaged values into a ValueError that names the store."""
    try:
        yield
    except (OSError, sqlite3.Error):
        raise
    except Exception as error:
        reason = f"{error} is missing" if isinstance(error, KeyError) else str(error) or type(error).__name__
        raise ValueError(f"{path} is a damaged store, move it away: {reason}") from error


def _texts(value: Any) -> dict[str, str]:
    return {name: _of(str, text) for name, text in _of(dict, value).items()}


def _size(value: Any) -> int:
    if not 0 <= _of(int, value) < 2**63:
        raise ValueError(f"expected a number of tasks or samples, got {reprlib.repr(value)}")
    return int(value)


def _of(kind: type[T], value: Any) -> T:
    """The value, if it is of this type; true and false are no numbers."""
    if type(value) is not kind:
        raise TypeError(f"expected a value of type {kind.__name__}, got {reprlib.repr(value)}")
    return value


OnChange = Literal["error", "keep", "restart"]
ON_CHANGE = ("error", "keep", "restart")

# Seconds to wait for another's lock, chosen by hand: a second writer is refused at once; a reader waits for a commit; a
# writer waits for readers, since rows that are finished would be lost.
_FOR_A_WRITER, _FOR_A_COMMIT, _FOR_READERS = 0.25, 10.0, 60.0
_LOCKED = errno.EAGAIN, "the store is locked: another process is writing to it"
_TROUBLE = {
    sqlite3.SQLITE_BUSY: _LOCKED,
    sqlite3.SQLITE_LOCKED: _LOCKED,
    sqlite3.SQLITE_FULL: (errno.ENOSPC, "the disk is full; every row that was reported is kept"),
    sqlite3.SQLITE_READONLY: (errno.EACCES, "the store is read-only"),
    sqlite3.SQLITE_CANTOPEN: (errno.EACCES, "the store cannot be opened or made there"),
}


class Store:
    """An open store; see `opened`."""

    def __init__(self, path: Path, database: sqlite3.Connection) -> None:
        self.path, self._database = path, database
        self._facts: Study | None = None  # as they were read or written last
        self._tasks: list[Column] = []  # seeds and parameters of all tasks

    @property
    def study(self) -> Study:
        facts = self._facts or self._read()
        if facts is None:
            raise ValueError(f"{self.path} is not a store of hysim: it is empty")
        return facts

    def begin(self, identity: Mapping[str, str], space: Space, seeds: Column, on_change: OnChange) -> None:
        self._tasks = [seeds, *space.columns.values()]
        self._database.execute("BEGIN IMMEDIATE")
        before = self._read()
        if before is not None and self._is_continued(identity, on_change):
            self._remember(before._replace(identity=identity))
        else:
            self._create(identity, space)
        self._commit()

    def space(self) -> Space:
        """The parameters of the tasks that have a row, and the axes of all."""
        with damage_named(self.path):
            kinds = {name: _KINDS[kind] for name, kind in self.study.kinds.items()}
            axes: dict[str, Column] = {name: np.array(values, kinds[name]) for name, values in self.study.axes or ()}
            parameters = self.study.parameters.items()
            columns: dict[str, Column] = {name: self._column(c, kinds[name]) for name, c in parameters}
        return Space(columns, axes or None)

    def restore(self, table: Table) -> None:
        """Enter the rows of the store into the table of its study."""
        with damage_named(self.path):
            table.begin(self.study.shapes)
            places = self._column("task", np.int64)
            if (outside := places[(places < 0) | (places >= table.done.size)]).size:
                raise ValueError(f"it has a row of the task {outside[0]}")
            failed = self._database.execute("SELECT task, error FROM results WHERE error IS NOT NULL ORDER BY task")
            table.errors = {place: str(error) for place, error in failed}
            table.seconds[places], table.done[places] = self._column("seconds", np.float64), True
            missing = {*places.tolist()} - table.errors.keys()
            for output in self.study.layout:
                values = table.values[output.name]
                if not output.shape:
                    values[places] = self._column(output.column, np.float64, math.nan)
                    continue
                known = np.zeros(table.done.size, dtype=bool)
                for tasks, arrays in self._arrays(output):
                    values[tasks], known[tasks] = arrays, True
                if lost := missing.difference(np.flatnonzero(known).tolist()):
                    raise ValueError(f"{output.name} of the task {min(lost)} is missing")

    def _arrays(self, output: Output) -> Iterator[tuple[Any, Any]]:
        """Places of tasks, and this output of each."""
        if not self.study.shards:
            column = _quoted([output.column])
            for task, cell in self._database.execute(f"SELECT task, {column} FROM results WHERE {column} IS NOT NULL"):
                yield task, np.frombuffer(cell, "<f8").reshape(output.shape)
            return
        folder = self.path.with_name(f"{self.path.name}.arrays")
        for (name,) in self._database.execute("SELECT DISTINCT shard FROM results WHERE shard IS NOT NULL"):
            if not re.fullmatch(rf"{self.study.shards}-[0-9]{{9,18}}\.npz", str(name)):
                raise ValueError(f"{name!r} is not the name of one of its files with arrays")
            with open(folder / name, "rb") as raw, np.load(raw, allow_pickle=False) as file:
                yield file["task"], file[f"output_{output.name}"]

    def commit(self, rows: Sequence[Rows], layout: Layout) -> None:
        """Write the rows of finished tasks, all or none of them; rows may be written again."""
        if not self._database.in_transaction:  # after an interrupt
            self._database.execute("BEGIN IMMEDIATE")
        try:
            self._write(rows, layout)
            self._commit()
        except BaseException:
            self._facts = None
            if self._database.in_transaction:
                self._database.execute("ROLLBACK")
            raise

    def _write(self, rows: Sequence[Rows], layout: Layout) -> None:
        if layout and not self.study.layout:
            self._add_outputs(layout)
        outputs = [output.column for output in self.study.layout]
        columns = ["task", "seconds", "error", "seed", *self.study.parameters.values(), *outputs]
        marks = ", ".join("?" * len(columns))
        statement = f"INSERT OR REPLACE INTO results ({_quoted(columns)}) VALUES ({marks})"
        self._database.executemany(statement, self._lines(rows))

    def _lines(self, rows: Sequence[Rows]) -> Iterator[tuple[Any, ...]]:
        for part in rows:
            nothing = [None] * part.places.size
            tasks = [column[part.places].tolist() for column in self._tasks]
            outputs = [_stored(part.outputs[name]) if part.outputs else nothing for name in self.study.shapes]
            own = part.places.tolist(), part.seconds.tolist(), part.errors or nothing
            yield from zip(*own, *tasks, *outputs, strict=True)

    def _read(self) -> Study | None:
        tables = [name for (name,) in self._database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
        if not tables:
            return None
        if {"study", "results"} - {*tables}:
            raise ValueError(f"{self.path} is a database, but not a store of hysim: it has other tables")
        with damage_named(self.path):
            facts = study_of(dict(self._database.execute("SELECT name, value FROM study")))
            columns = {name for _, name, *_ in self._database.execute("PRAGMA table_info(results)")}
            outputs = [output.column for output in facts.layout if not (output.shape and facts.shards)]
            if missing := {*OWN_NAMES, *facts.parameters.values(), *outputs} - columns:  # SQLite takes it for text
                raise ValueError(f"it has no column {', '.join(map(repr, sorted(missing)))}")
        self._facts = facts
        return facts

    def changes(self, now: Mapping[str, str], on_change: OnChange) -> dict[str, str]:
        """Differences from the study in the store, in words; empty where its rows are to be kept all the same."""
        changes = _changes(self.study.identity, now)
        if self.study.shards:
            changes["space"] = "its arrays are in files of version 0.2, which are read, and not continued"
        return {} if on_change == "keep" and not {"space", "seed"} & changes.keys() else changes

    def _is_continued(self, now: Mapping[str, str], on_change: OnChange) -> bool:
        changes = self.changes(now, on_change)
        if not changes or on_change == "restart":
            return not changes
        keep = "" if {"space", "seed"} & changes.keys() else 'on_change="keep" to keep the finished rows and go on, or '
        advice = f'Pass another store, or {keep}on_change="restart" to begin again'
        raise ValueError(f"{self.path} holds another study: {'; '.join(changes.values())}. {advice}")

    def _create(self, identity: Mapping[str, str], space: Space) -> None:
        for table in ("results", "study"):
            self._database.execute(f"DROP TABLE IF EXISTS {table}")
        parameters = _distinct(space.columns, OWN_NAMES)
        own = "task INTEGER PRIMARY KEY, seed INTEGER, seconds, error TEXT"
        self._database.execute("CREATE TABLE study (name TEXT PRIMARY KEY, value TEXT)")
        self._database.execute(f"CREATE TABLE results ({own}, {_quoted(parameters.values())})")
        kinds = {name: column.dtype.kind for name, column in space.columns.items()}
        axes = [(name, values.tolist()) for name, values in (space.axes or {}).items()] or None
        self._remember(Study(identity, space.n_tasks, parameters, kinds, axes))

    def _add_outputs(self, layout: Layout) -> None:
        columns = _distinct(layout, (*OWN_NAMES, *self.study.parameters.values()))
        self._remember(self.study._replace(layout=[Output(name, layout[name], columns[name]) for name in layout]))
        for column in columns.values():
            self._database.execute(f"ALTER TABLE results ADD COLUMN {_quoted([column])}")

    def _remember(self, study: Study) -> None:
        facts = [(name, json.dumps(value)) for name, value in study._asdict().items() if value or name == "axes"]
        self._database.executemany("INSERT OR REPLACE INTO study VALUES (?, ?)", facts)
        self._facts = study

    def _column(self, name: str, kind: Any, empty: float | None = None) -> Column:
        """Values of the rows; ValueError for a row without one, but that NULL is nan in outputs."""
        cells = [cell for (cell,) in self._database.execute(f"SELECT {_quoted([name])} FROM results ORDER BY task")]
        if None in cells and empty is None:
            raise ValueError(f"a row has no {name!r}")
        return np.array([empty if cell is None else cell for cell in cells], kind)

    def _commit(self) -> None:
        self._database.execute("COMMIT")
        self._database.execute(f"PRAGMA busy_timeout = {1000 * _FOR_READERS:.0f}")
        self._database.execute("BEGIN IMMEDIATE")


@contextmanager
def opened(path: str | Path, *, to_read: bool = False) -> Iterator[Store]:
    """The store in a file, created if missing and to be written; OSError with the reason, ValueError if unreadable."""
    path = Path(path)
    if to_read and not path.is_file():
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(path))
    try:
        with closing(_connected(path, "rw" if to_read else "rwc")) as database:
            if to_read:
                database.execute("BEGIN")  # so that all rows are of one moment
            yield Store(path, database)  # whose open transaction is rolled back in the end
    except sqlite3.DatabaseError as error:
        code = vars(error).get("sqlite_errorcode", 0) & 0xFF  # errors of the module itself have none
        if code in (sqlite3.SQLITE_NOTADB, sqlite3.SQLITE_CORRUPT):
            raise ValueError(f"{path} is not a store of hysim: {error}") from error
        number, message = _TROUBLE.get(code, (errno.EIO, f"the store failed: {error}"))
        raise OSError(number, message, str(path)) from error


def _connected(path: Path, mode: str) -> sqlite3.Connection:
    """A connection; a reader may write too: the unfinished transaction of a killed writer is first rolled back."""
    timeout = _FOR_A_WRITER if mode == "rwc" else _FOR_A_COMMIT
    return sqlite3.connect(f"{path.resolve().as_uri()}?mode={mode}", uri=True, timeout=timeout, isolation_level=None)


def _changes(before: Mapping[str, str], now: Mapping[str, str]) -> dict[str, str]:
    words = {name: f"the {name} was {before.get(name)} and is {value}" for name, value in now.items()}
    words["task"] = "the task's source or a value bound to it has changed"
    tasks = now["space"].rpartition(" (")[0]  # without the digest of the values
    if before.get("space", "").rpartition(" (")[0] == tasks:
        words["space"] = f"other values of the parameters ({tasks}, as before)"
    return {name: text for name, text in words.items() if before.get(name) != now[name]}


def _distinct(names: Iterable[str], taken: Iterable[str]) -> dict[str, str]:
    """Names of columns that differ in SQL, where A equals a."""
    used, columns = {name.lower() for name in taken}, {}
    for name in names:
        numbered = chain([name], (f"{name}_{k}" for k in count(2)))
        columns[name] = next(column for column in numbered if column.lower() not in used)
        used.add(columns[name].lower())
    return columns


def _quoted(columns: Iterable[str]) -> str:
    return ", ".join('"' + column.replace('"', '""') + '"' for column in columns)


def _stored(column: Column) -> Iterable[Any]:
    """Values of an output as SQLite takes them: numbers, or the bytes of arrays."""
    return column.tolist() if column.ndim == 1 else map(np.ndarray.tobytes, column.astype("<f8"))
