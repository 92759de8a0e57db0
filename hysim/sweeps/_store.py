"""A study on disk: an SQLite database with one row for each finished task, and arrays beside it.

    study      what the study is: its identity, its parameters, the axes of a grid, the layout of a row
    results    task, seed, seconds, error, shard; then the parameters, then the outputs that are numbers

A row is there or not: rows are written in transactions, and the arrays that they name are in files, one for each
transaction, which are whole before it begins. Their names begin with the study's own digits: no other file in the
folder is ever touched, and none outside it read. Columns have no declared type, which would cost zeros their sign; an
output that is nan is NULL in a row without an error. From one transaction to the next the writer holds SQLite's
lock for writing, so that nobody else writes, and everybody may read.
"""

import errno
import os
import re
import secrets
import sqlite3
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from hysim._atomic import whole
from hysim._frozen import FloatArray
from hysim.sweeps._chunks import Group, Layout, Outcome
from hysim.sweeps._space import Column, Space
from hysim.sweeps._study import Output, Study, damage_named, study_of

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
        self._facts: Study | None = None  # as they were read or written last

    def begin(self, identity: Mapping[str, str], space: Space, on_change: OnChange) -> None:
        """Make the store that of this study, or refuse it."""
        self._database.execute("BEGIN IMMEDIATE")
        before = self._read()
        goes_on = before is not None and self._goes_on(before.identity, identity, on_change)
        if before is None or not goes_on:
            self._refuse_arrays_of_others(before)
            self._create(identity, space, before)
        else:
            self._remember(before._replace(identity=identity))
        self._commit()
        for study in (self._study, *(() if before is None else (before,))):
            self._remove_shards_without_rows(study)

    def space(self) -> Space:
        """Parameters and axes of the rows that are there."""
        study = self._study
        with damage_named(self.path):
            axes = {name: _as_column(values, study.kinds[name]) for name, values in study.axes or ()} or None
            columns = {
                name: _as_column(self._filled(column), study.kinds[name]) for name, column in study.parameters.items()
            }
        return Space(columns, axes)

    @property
    def n_tasks(self) -> int:
        """Number of tasks that the study has, finished or not."""
        return self._study.n_tasks

    @property
    def seed(self) -> int:
        """Of the study."""
        return int(self._study.identity["seed"])

    def layout(self) -> Layout | None:
        """Names and shapes of a row, None before the first task that succeeds."""
        return tuple((output.name, output.shape) for output in self._study.layout or ()) or None

    def finished(self) -> Outcome:
        """All rows that are there, in the order of the tasks."""
        with damage_named(self.path):
            return self._finished()

    def _finished(self) -> Outcome:
        places = np.array(self._column("task"), dtype=np.int64)
        if places.size and not 0 <= places[0] <= places[-1] < self.n_tasks:
            raise ValueError(f"it has a row of the task {places[0] if places[0] < 0 else places[-1]}")
        messages = self._column("error")
        failed = {place: str(text) for place, text in zip(places.tolist(), messages, strict=True) if text is not None}
        seconds = np.array(self._filled("seconds"), dtype=float)
        layout = self._study.layout or ()
        good = np.array([text is None for text in messages], dtype=bool)
        arrays = self._arrays(places[good]) if any(output.shape for output in layout) else {}
        columns = [
            arrays[output.name] if output.shape else np.array(self._column(output.column), dtype=float)[good]
            for output in layout
        ]
        group = Group(tuple((output.name, output.shape) for output in layout), places[good], tuple(columns))
        return Outcome(places, (group,) if columns else (), failed, seconds)

    def commit(self, outcomes: list[Outcome], layout: Layout | None, space: Space, seeds: Column) -> None:
        """Write the rows of finished chunks, all or none of them; what was written before may be written again."""
        if not self._database.in_transaction:  # after an interrupt
            self._database.execute("BEGIN IMMEDIATE")
        try:
            self._write(outcomes, layout, space, seeds)
            self._commit()
        except BaseException:
            self._facts = None
            if self._database.in_transaction:
                self._database.execute("ROLLBACK")
            raise

    def _write(self, outcomes: list[Outcome], layout: Layout | None, space: Space, seeds: Column) -> None:
        if layout and not self._study.layout:
            self._lay_out(layout)
        names = [*_OWN_COLUMNS, *self._study.parameters.values()]
        outputs = [output.column for output in self._study.layout or () if not output.shape]
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
            f"INSERT OR REPLACE INTO results ({_quoted(names)}) VALUES ({', '.join('?' * len(names))})",
            zip(*columns, strict=True),
        )

    @property
    def _study(self) -> Study:
        facts = self._facts or self._read()
        if facts is None:
            raise ValueError(f"{self.path} is not a store of hysim: it is empty")
        return facts

    def _read(self) -> Study | None:
        """The study that the store holds; None if it is new."""
        tables = [name for (name,) in self._database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
        if not tables:
            return None
        if {"study", "results"} - {*tables}:
            raise ValueError(f"{self.path} is a database, but not a store of hysim: it has other tables")
        with damage_named(self.path):
            facts = study_of(dict(self._database.execute("SELECT name, value FROM study")))
            columns = {name for _, name, *_ in self._database.execute("PRAGMA table_info(results)")}
            if missing := {*_OWN_COLUMNS, *facts.columns} - columns:  # which SQLite would take for a text
                raise ValueError(f"it has no column {', '.join(map(repr, sorted(missing)))}")
        self._facts = facts
        return facts

    def _goes_on(self, before: Mapping[str, str], now: Mapping[str, str], on_change: OnChange) -> bool:
        """Whether the rows that are there are kept."""
        changes = _changes(before, now)
        if not changes or on_change == "restart":
            return not changes
        is_other = bool({"space", "seed"} & changes.keys())
        if on_change == "keep" and not is_other:
            return True
        mend = 'on_change="restart" begins anew'
        if not is_other:
            mend = f'on_change="keep" keeps the finished rows and goes on, {mend}'
        raise ValueError(
            f"{self.path} holds another study: {'; '.join(changes.values())}. Give another store, or say what to do: "
            f"{mend}"
        )

    def _create(self, identity: Mapping[str, str], space: Space, before: Study | None) -> None:
        if before is not None:
            self._database.execute("DROP TABLE results")
            self._database.execute("DROP TABLE study")
        parameters = _distinct(space.columns, _OWN_COLUMNS)
        self._database.execute("CREATE TABLE study (name TEXT PRIMARY KEY, value TEXT)")
        self._database.execute(
            "CREATE TABLE results (task INTEGER PRIMARY KEY, seed INTEGER, seconds, error TEXT, shard TEXT, "
            f"{_quoted(parameters.values())})"
        )
        self._remember(
            Study(
                identity=identity,
                n_tasks=space.n_tasks,
                parameters=parameters,
                kinds={name: column.dtype.kind for name, column in space.columns.items()},
                axes=tuple((name, values.tolist()) for name, values in (space.axes or {}).items()) or None,
                layout=None,
                shards=secrets.token_hex(8),
            )
        )

    def _lay_out(self, layout: Layout) -> None:
        columns = _distinct([name for name, _ in layout], (*_OWN_COLUMNS, *self._study.parameters.values()))
        for name, shape in layout:
            if not shape:
                self._database.execute(f"ALTER TABLE results ADD COLUMN {_quoted([columns[name]])}")
        outputs = tuple(Output(name, shape, columns[name]) for name, shape in layout)
        self._remember(self._study._replace(layout=outputs))

    def _remember(self, study: Study) -> None:
        self._database.executemany("INSERT OR REPLACE INTO study VALUES (?, ?)", study.rows.items())
        self._facts = study

    def _filled(self, name: str) -> list[Any]:
        """A column in which each row has a value; `None` in an output is a nan, which SQLite does not know."""
        values = self._column(name)
        if None in values:
            raise ValueError(f"a row has no {name!r}")
        return values

    def _column(self, name: str) -> list[Any]:
        return [value for (value,) in self._database.execute(f"SELECT {_quoted([name])} FROM results ORDER BY task")]

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
        name = f"{self._study.shards}-{places.min():09d}.npz"
        self._folder.mkdir(exist_ok=True)
        with whole(self._shard(name), "xb") as file:
            np.savez(file, task=places, **arrays)  # type: ignore[arg-type]
            file.flush()
            os.fsync(file.fileno())
        return name

    def _arrays(self, places: npt.NDArray[np.int64]) -> dict[str, FloatArray]:
        """Arrays of the tasks at these places, read from the shards that hold them."""
        shapes = {output.name: output.shape for output in self._study.layout or () if output.shape}
        arrays = {name: np.empty((places.size, *shape)) for name, shape in shapes.items()}
        filled = np.zeros(places.size, dtype=bool)
        for shard in sorted({name for name in self._column("shard") if name}):
            with open(self._shard(shard), "rb") as raw, np.load(raw, allow_pickle=False) as file:
                tasks = file["task"]
                rows = np.searchsorted(places, tasks)
                if not np.array_equal(places[rows], tasks):
                    raise ValueError(f"{shard} holds tasks that have no row")
                for name, array in arrays.items():
                    array[rows] = file[f"output_{name}"]
                filled[rows] = True
        if not filled.all():
            raise ValueError(f"the arrays of the task {places[~filled][0]} are missing")
        return arrays

    def _shard(self, name: Any) -> Path:
        """The file of this name, which is one of this study's and in its folder."""
        if not isinstance(name, str) or not self._is_shard(name, self._study):
            raise ValueError(f"{name!r} is not the name of one of its files with arrays")
        path = self._folder / name
        if path.is_symlink():
            raise ValueError(f"{path} is a link, and not a file with arrays")
        return path

    @staticmethod
    def _is_shard(name: str, study: Study) -> bool:
        """Whether a file of this name is a shard of the study, or was to become one."""
        return re.fullmatch(rf"{study.shards}-[0-9]{{9,18}}\.npz", name) is not None

    def _refuse_arrays_of_others(self, before: Study | None) -> None:
        """Refuse a folder with arrays that are not of the study that was here before."""
        for path in sorted(self._folder.iterdir()) if self._folder.is_dir() else ():
            if path.suffix == ".npz" and not (before is not None and self._is_shard(path.name, before)):
                raise ValueError(
                    f"{path} is not of this study: move it, or the folder, away, or give the study another store"
                )

    def _remove_shards_without_rows(self, study: Study) -> None:
        """Files of a study that were written before a transaction that never came, or of one that is no more."""
        named = {*self._column("shard")}
        for path in self._folder.iterdir() if self._folder.is_dir() else ():
            name = re.sub(r"^\.(.*\.npz)\.[0-9a-f]{16}$", r"\1", path.name)  # as it is called while it is written
            if self._is_shard(name, study) and path.name not in named:
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
    tasks = now["space"].rpartition(" (")[0]  # without the digest of the values
    if "space" in words and before.get("space", "").rpartition(" (")[0] == tasks:
        words["space"] = f"other values of the parameters ({tasks}, as before)"
    return words


def _distinct(names: Iterable[str], taken: tuple[str, ...]) -> dict[str, str]:
    """Names of columns in SQL, which does not tell A from a."""
    used, columns = {name.lower() for name in taken}, {}
    for name in names:
        column, k = name, 1
        while column.lower() in used:
            k += 1
            column = f"{name}_{k}"
        used.add(column.lower())
        columns[name] = column
    return columns


def _quoted(columns: Iterable[str]) -> str:
    """Names as SQL takes them, whatever signs they have."""
    return ", ".join('"' + column.replace('"', '""') + '"' for column in columns)


def _as_column(values: list[Any], kind: str) -> Column:
    return np.array(values, dtype={"f": np.float64, "i": np.int64, "b": bool, "U": str}[kind])
