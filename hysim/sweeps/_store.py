"""A study on disk: an SQLite database with one row for each finished task, and arrays beside it.

    study      what the study is: its identity, its parameters, the axes of a grid, the layout of a row
    results    task, seed, seconds, error, shard; then the parameters, then the outputs that are numbers

Rows are written in transactions. The arrays of a transaction are in one file, a shard, which is complete before the
transaction begins. Shards begin with digits of the study: other files in the folder are never changed, and files
outside it never read. Columns have no declared type, since zeros would lose their sign; nan is NULL in a row without an
error. Between transactions the writer keeps SQLite's lock for writing: others may read, not write.

The facts of a study are checked when they are read from a store:

    identity     name to text, which must be equal for two studies to be the same
    n_tasks      number of tasks
    parameters   name to column of the table of results
    kinds        name to kind of its values, as NumPy has it
    axes         names and values of the axes of a grid, or null
    layout       names, shapes and columns of the outputs, once a task has succeeded
    shards       what the names of the files with arrays begin with
"""

import errno
import json
import math
import os
import re
import reprlib
import secrets
import sqlite3
from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing, contextmanager
from itertools import chain, count
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeVar
from zipfile import BadZipFile
from zlib import error as CompressionError  # noqa: N812

import numpy as np
import numpy.typing as npt

from hysim._basics.atomic import replacing
from hysim._basics.frozen import FloatArray
from hysim.sweeps._chunks import Group, Layout, Outcome
from hysim.sweeps._space import Column, Space

T = TypeVar("T")

_KINDS = "fibU"
_TOKEN = re.compile(r"[0-9a-f]{16}")
_DAMAGE = (
    ArithmeticError, AttributeError, BadZipFile, CompressionError, EOFError, LookupError, RecursionError, TypeError,
    ValueError,
)  # fmt: skip


class Output(NamedTuple):
    """Name and shape of an output, and its column if it is a number."""

    name: str
    shape: tuple[int, ...]
    column: str


class Study(NamedTuple):
    """The facts of a study; see the module."""

    identity: Mapping[str, str]
    n_tasks: int
    parameters: Mapping[str, str]
    kinds: Mapping[str, str]
    axes: tuple[tuple[str, list[Any]], ...] | None
    layout: tuple[Output, ...] | None
    shards: str

    @property
    def columns(self) -> list[str]:
        outputs = [output.column for output in self.layout or () if not output.shape]
        return [*self.parameters.values(), *outputs]

    @property
    def rows(self) -> dict[str, str]:
        """The facts as texts in JSON, by their names; without a layout before it is known."""
        return {name: json.dumps(value) for name, value in self._asdict().items() if (name, value) != ("layout", None)}


def study_of(rows: Mapping[str, Any]) -> Study:
    """The study in the rows of a store; any of `_DAMAGE` if they are damaged."""
    facts = {name: json.loads(text) for name, text in rows.items()}
    identity, parameters, kinds = (_texts(facts[name]) for name in ("identity", "parameters", "kinds"))
    axes = None if facts["axes"] is None else tuple((_of(str, name), _of(list, v)) for name, v in facts["axes"])
    layout = tuple(_output(*each) for each in _of(list, facts["layout"])) if "layout" in facts else None
    study = Study(identity, _number(facts["n_tasks"]), parameters, kinds, axes, layout, _of(str, facts["shards"]))
    int(study.identity["seed"])
    if study.layout == ():
        raise ValueError("the layout has no output")
    if not study.parameters or study.parameters.keys() != study.kinds.keys():
        raise ValueError("parameters and kinds do not have the same names")
    if not {*study.kinds.values()} <= {*_KINDS}:
        raise ValueError(f"kinds must be among {', '.join(_KINDS)}, got {', '.join(study.kinds.values())}")
    if study.axes is not None:
        if [name for name, _ in study.axes] != [*study.parameters]:
            raise ValueError("axes and parameters do not have the same names")
        if math.prod(len(values) for _, values in study.axes) != study.n_tasks:
            raise ValueError(f"its axes do not have {study.n_tasks} combinations")
    if not _TOKEN.fullmatch(study.shards):
        raise ValueError("the names of shards do not begin with 16 hexadecimal digits")
    return study


@contextmanager
def damage_named(path: str | Path) -> Iterator[None]:
    """Turn the errors of damaged values into a ValueError that names the store."""
    try:
        yield
    except _DAMAGE as error:
        reason = f"{error} is missing" if isinstance(error, KeyError) else str(error) or type(error).__name__
        raise ValueError(f"{path} is a damaged store, move it away: {reason}") from error


def _output(name: Any, shape: Any, column: Any) -> Output:
    return Output(_of(str, name), tuple(_number(length) for length in shape), _of(str, column))


def _texts(value: Any) -> dict[str, str]:
    return {name: _of(str, text) for name, text in _of(dict, value).items()}


def _number(value: Any) -> int:
    number = _of(int, value)
    if not 0 <= number < 2**63:
        raise ValueError(f"expected a number of tasks or samples, got {reprlib.repr(number)}")
    return number


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
        self._tasks: list[Column] = []  # seeds and parameters of all tasks

    def begin(self, identity: Mapping[str, str], space: Space, seeds: Column, on_change: OnChange) -> None:
        self._tasks = [seeds, *space.columns.values()]
        self._database.execute("BEGIN IMMEDIATE")
        before = self._read()
        if before is not None and self._is_continued(before.identity, identity, on_change):
            self._remember(before._replace(identity=identity))
        else:
            self._refuse_arrays_of_others(before)
            self._create(identity, space, before)
        self._commit()
        for study in (self._study, before or self._study):
            self._remove_shards_without_rows(study)

    def space(self) -> Space:
        study = self._study
        with damage_named(self.path):
            axes = {name: _as_column(values, study.kinds[name]) for name, values in study.axes or ()} or None
            columns = {
                name: _as_column(self._filled(column), study.kinds[name]) for name, column in study.parameters.items()
            }
        return Space(columns, axes)

    @property
    def n_tasks(self) -> int:
        return self._study.n_tasks

    @property
    def seed(self) -> int:
        return int(self._study.identity["seed"])

    def layout(self) -> Layout | None:
        """Names and shapes of a row, None before the first task that succeeds."""
        return tuple((output.name, output.shape) for output in self._study.layout or ()) or None

    def finished(self) -> Outcome:
        with damage_named(self.path):
            places = np.array(self._column("task"), dtype=np.int64)
            if places.size and not 0 <= places[0] <= places[-1] < self.n_tasks:
                raise ValueError(f"it has a row of the task {places[0] if places[0] < 0 else places[-1]}")
            messages = dict(zip(places.tolist(), self._column("error"), strict=True))
            good = np.array([text is None for text in messages.values()], dtype=bool)
            layout = self._study.layout or ()
            arrays = self._arrays(places[good]) if any(output.shape for output in layout) else {}
            columns = [
                arrays[output.name] if output.shape else np.array(self._column(output.column), dtype=float)[good]
                for output in layout
            ]
            return Outcome(
                places,
                (Group(self.layout() or (), places[good], tuple(columns)),) if columns else (),
                {place: str(text) for place, text in messages.items() if text is not None},
                np.array(self._filled("seconds"), dtype=float),
            )

    def commit(self, outcomes: list[Outcome], layout: Layout | None) -> None:
        """Write the rows of finished chunks, all or none of them; rows may be written again."""
        if not self._database.in_transaction:  # after an interrupt
            self._database.execute("BEGIN IMMEDIATE")
        try:
            self._write(outcomes, layout)
            self._commit()
        except BaseException:
            self._facts = None
            if self._database.in_transaction:
                self._database.execute("ROLLBACK")
            raise

    def _write(self, outcomes: list[Outcome], layout: Layout | None) -> None:
        if layout and not self._study.layout:
            self._add_outputs(layout)
        names = [*_OWN_COLUMNS, *self._study.parameters.values()]
        outputs = [output.column for output in self._study.layout or () if not output.shape]
        shard = self._write_shard(outcomes)
        for outcome in outcomes:
            seconds = dict(zip(outcome.places.tolist(), outcome.seconds.tolist(), strict=True))
            failed = Group((), np.array([*outcome.errors], dtype=np.int64), ())
            for group in (*outcome.groups, failed):
                keys, numbers = group.places.tolist(), zip(group.layout, group.columns, strict=True)
                seeds, *parameters = (column[group.places].tolist() for column in self._tasks)
                own = (
                    keys, seeds, [seconds[key] for key in keys], [outcome.errors.get(key) for key in keys],
                    [shard if group.layout else None] * len(keys),
                )  # fmt: skip
                columns = [*own, *parameters, *(column.tolist() for (_, shape), column in numbers if not shape)]
                filled = _quoted([*names, *(outputs if group.layout else [])])
                places = ", ".join("?" * len(columns))
                rows = zip(*columns, strict=True)
                self._database.executemany(f"INSERT OR REPLACE INTO results ({filled}) VALUES ({places})", rows)

    @property
    def _study(self) -> Study:
        facts = self._facts or self._read()
        if facts is None:
            raise ValueError(f"{self.path} is not a store of hysim: it is empty")
        return facts

    def _read(self) -> Study | None:
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

    def _is_continued(self, before: Mapping[str, str], now: Mapping[str, str], on_change: OnChange) -> bool:
        changes = _changes(before, now)
        if not changes or on_change == "restart":
            return not changes
        has_same_tasks = not {"space", "seed"} & changes.keys()
        if on_change == "keep" and has_same_tasks:
            return True
        keep = 'on_change="keep" to keep the finished rows and go on, or ' if has_same_tasks else ""
        raise ValueError(
            f"{self.path} holds another study: {'; '.join(changes.values())}. Pass another store, or {keep}"
            'on_change="restart" to begin again'
        )

    def _create(self, identity: Mapping[str, str], space: Space, before: Study | None) -> None:
        for table in ("results", "study") if before is not None else ():
            self._database.execute(f"DROP TABLE {table}")
        parameters = _distinct(space.columns, _OWN_COLUMNS)
        self._database.execute("CREATE TABLE study (name TEXT PRIMARY KEY, value TEXT)")
        self._database.execute(
            "CREATE TABLE results (task INTEGER PRIMARY KEY, seed INTEGER, seconds, error TEXT, shard TEXT, "
            f"{_quoted(parameters.values())})"
        )
        kinds = {name: column.dtype.kind for name, column in space.columns.items()}
        axes = tuple((name, values.tolist()) for name, values in (space.axes or {}).items()) or None
        self._remember(
            Study(identity, space.n_tasks, parameters, kinds, axes, layout=None, shards=secrets.token_hex(8))
        )

    def _add_outputs(self, layout: Layout) -> None:
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
        """A column in which each row must have a value; in outputs NULL is nan, which SQLite does not know."""
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
        with replacing(self._shard(name), "xb") as file:
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
        """Path of the shard of this name; ValueError unless it is a shard of this study and no link."""
        if not isinstance(name, str) or not self._is_shard(name, self._study):
            raise ValueError(f"{name!r} is not the name of one of its files with arrays")
        path = self._folder / name
        if path.is_symlink():
            raise ValueError(f"{path} is a link, and not a file with arrays")
        return path

    @staticmethod
    def _is_shard(name: str, study: Study) -> bool:
        return re.fullmatch(rf"{study.shards}-[0-9]{{9,18}}\.npz", name) is not None

    def _refuse_arrays_of_others(self, before: Study | None) -> None:
        """Refuse a folder with arrays that do not belong to the study that was in the store before."""
        for path in sorted(self._folder.iterdir()) if self._folder.is_dir() else ():
            if path.suffix == ".npz" and not (before is not None and self._is_shard(path.name, before)):
                raise ValueError(f"{path} does not belong to this study: move it or the folder, or use another store")

    def _remove_shards_without_rows(self, study: Study) -> None:
        """Remove the shards of a study that no row names: their transaction failed, or the study was replaced."""
        shards = {*self._column("shard")}
        for path in self._folder.iterdir() if self._folder.is_dir() else ():
            name = re.sub(r"^\.(.*\.npz)\.[0-9a-f]{16}$", r"\1", path.name)  # without what the name has during writing
            if self._is_shard(name, study) and path.name not in shards:
                path.unlink()


@contextmanager
def opened(path: str | Path, *, to_read: bool = False) -> Iterator[Store]:
    """The store in a file, created if missing and to be written; OSError with the reason, ValueError if it is none."""
    path = Path(path)
    if to_read and not path.is_file():
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(path))
    with _built_in_errors(path), closing(_connected(path, "rw" if to_read else "rwc")) as database:
        if to_read:
            database.execute("BEGIN")  # so that all rows are of one moment
        yield Store(path, database)  # whose open transaction is rolled back in the end


def _connected(path: Path, mode: str) -> sqlite3.Connection:
    """A connection; a reader may write too: the unfinished transaction of a killed writer is first rolled back."""
    timeout = _FOR_A_WRITER if mode == "rwc" else _FOR_A_COMMIT
    return sqlite3.connect(f"{path.resolve().as_uri()}?mode={mode}", uri=True, timeout=timeout, isolation_level=None)


@contextmanager
def _built_in_errors(path: Path) -> Iterator[None]:
    try:
        yield
    except sqlite3.DatabaseError as error:
        code = vars(error).get("sqlite_errorcode", 0) & 0xFF  # errors of the module itself have none
        if code in (sqlite3.SQLITE_NOTADB, sqlite3.SQLITE_CORRUPT):
            raise ValueError(f"{path} is not a store of hysim: {error}") from error
        number, message = _TROUBLE.get(code, (errno.EIO, f"the store failed: {error}"))
        raise OSError(number, message, str(path)) from error


def _changes(before: Mapping[str, str], now: Mapping[str, str]) -> dict[str, str]:
    words = {name: f"the {name} was {before.get(name)} and is {value}" for name, value in now.items()}
    words["task"] = "the task's source or a value bound to it has changed"
    tasks = now["space"].rpartition(" (")[0]  # without the digest of the values
    if before.get("space", "").rpartition(" (")[0] == tasks:
        words["space"] = f"other values of the parameters ({tasks}, as before)"
    return {name: text for name, text in words.items() if before.get(name) != now[name]}


def _distinct(names: Iterable[str], taken: tuple[str, ...]) -> dict[str, str]:
    """Names of columns that differ in SQL, where A equals a."""
    used, columns = {name.lower() for name in taken}, {}
    for name in names:
        numbered = chain([name], (f"{name}_{k}" for k in count(2)))
        columns[name] = next(column for column in numbered if column.lower() not in used)
        used.add(columns[name].lower())
    return columns


def _quoted(columns: Iterable[str]) -> str:
    return ", ".join('"' + column.replace('"', '""') + '"' for column in columns)


def _as_column(values: list[Any], kind: str) -> Column:
    return np.array(values, dtype={"f": np.float64, "i": np.int64, "b": bool, "U": str}[kind])
