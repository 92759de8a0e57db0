"""Printed results: ``str`` has at most ten lines of a hundred letters and no array, ``repr`` is its first line."""

import csv
import importlib
import io
import math
import re
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NoReturn, TypeVar, dataclass_transform

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import frozen

LINES, LETTERS = 10, 100
_FORMULA = re.compile(r"'*[=+@\t\r-]")
_NOTEBOOKS = "hysim.notebooks"

_PICTURES = {
    "Record": "hs.plot.loop(record) or hs.plot.history(record)",
    "Simulation": "hs.plot.loop(run) or hs.plot.history(run)",
    "Identification": "hs.plot.identification(fit, record)",
    "ClosedLoop": "hs.plot.response(run)",
    "Comparison": "hs.plot.comparison(table)",
    "Discovery": "hs.plot.selection(discovery)",
    "OscillatorDiscovery": "hs.plot.selection(discovery)",
    "Tuning": "hs.plot.trade_off(tuning)",
    "Sweep": 'hs.plot.parallel_coordinates(study, "output")',
    "SobolIndices": 'hs.plot.sensitivities(indices, "output")',
    "Fragility": "hs.plot.fragility(curve)",
    "ResponseSpectrum": "hs.plot.spectrum(spectrum)",
    "LoopMetrics": "hs.plot.width(metrics)",
    "LossMap": "hs.plot.loss_map(result)",
}
"""Functions that draw a result, by the name of its class."""

T = TypeVar("T")


def printed(cls: type[T]) -> type[T]:
    """Give a class that has a ``__str__`` a ``repr`` of one line, and let notebooks show all lines."""
    cls.__repr__ = _first_line  # type: ignore[method-assign]
    cls.__getattr__ = _no_attribute  # type: ignore[attr-defined]
    return shown(cls)


@dataclass_transform(kw_only_default=True, frozen_default=True)
def frozen_result(cls: type[T]) -> type[T]:
    """Make `cls`, which has a ``__str__``, the result of a verb: frozen, as by `frozen`, and `printed`."""
    return printed(frozen(cls))


def shown(cls: type[T]) -> type[T]:
    """Let notebooks show the text of ``str``, and the page that `hysim.notebooks` makes of some classes."""
    cls._repr_mimebundle_ = _bundle  # type: ignore[attr-defined]
    cls._repr_html_ = _page  # type: ignore[attr-defined]
    return cls


def bic_in_words(bic: float) -> str:
    """The BIC; it is minus infinity and not defined if every residual is zero."""
    return "BIC not defined" if bic == -math.inf else f"BIC {bic:.1f}"


def summary_text(lines: Iterable[str], rows: Mapping[str, str] | None = None) -> str:
    width = max(map(len, rows or {}), default=0)
    named = [_cut(f"  {name:<{width}}  ", text) for name, text in (rows or {}).items() if text]
    all_lines = [part for line in [*lines, *named] for part in line.splitlines()]
    if len(all_lines) > LINES:
        all_lines = [*all_lines[: LINES - 1], f"  ... and {len(all_lines) - LINES + 1} lines more"]
    return "\n".join(line if len(line) <= LETTERS else line[: LETTERS - 4].rstrip() + " ..." for line in all_lines)


def wrapped(parts: Iterable[str], *, most: int = 3, first: str = "  ") -> str:
    """Short parts in at most `most` lines, with the number of those that have no room."""
    unbroken = [part.replace(" ", "\0") for part in parts]
    indent = " " * len(first)
    for number in range(len(unbroken), 0, -1):
        more = len(unbroken) - number
        text = ", ".join(unbroken[:number]) + (f", and\0{more}\0more" if more else "")
        lines = folded(text, first=first, indent=indent)
        if len(lines) <= most:
            return "\n".join(lines).replace("\0", " ")
    return ""


def aligned(table: Sequence[Sequence[str]], first: Callable[[str, int], str] = str.ljust) -> list[str]:
    """Lines of cells; the first column is aligned to the left, the others to the right."""
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    return ["  ".join([first(row[0], widths[0]), *map(str.rjust, row[1:], widths[1:])]) for row in table]


def folded(text: str, width: int = LETTERS, first: str = "", indent: str = "") -> list[str]:
    """Lines of at most so many letters; words with hyphens stay whole."""
    return textwrap.wrap(text, width, initial_indent=first, subsequent_indent=indent, break_on_hyphens=False)


def csv_text(rows: Iterable[Iterable[Any]], *, delimiter: str = ",", nan: str = "") -> str:
    """Rows as comma-separated values; floats with all digits, None as an empty cell, texts as `text_in_cell` reads."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, delimiter=delimiter, lineterminator="\n")
    writer.writerows([nan if value != value else _cell(value) for value in row] for row in rows)
    return buffer.getvalue()


def _cell(value: Any) -> Any:
    """The value; a text that a spreadsheet would compute as a formula has an apostrophe before it."""
    return f"'{value}" if isinstance(value, str) and _FORMULA.match(value) and not _is_number(value) else value


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def text_in_cell(cell: str) -> str:
    return cell[1:] if cell.startswith("'") and _FORMULA.match(cell, 1) else cell


def listed(names: Sequence[str]) -> str:
    """Names in a sentence: a, b and c."""
    return f"{', '.join(names[:-1])} and {names[-1]}" if len(names) > 1 else "".join(names)


def quantity(value: float, unit: str = "") -> str:
    return f"{value:.4g} {unit}".rstrip()


def extent(values: npt.ArrayLike, unit: str = "") -> str:
    array = np.asarray(values)
    if not array.size:
        return "no values"
    low, high = float(array.min()), float(array.max())
    return quantity(low, unit) if low == high else f"{low:.4g} to {quantity(high, unit)}"


def value_in_words(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return f"{' x '.join(map(str, value.shape)) or '1'} values, {extent(value)}"
    if isinstance(value, tuple):
        if len(value) > 4 and all(isinstance(each, float) for each in value):
            return value_in_words(np.array(value))
        return f"({', '.join(map(value_in_words, value))})"
    if isinstance(value, float):
        return f"{value:.6g}"
    return repr(value) if isinstance(value, str) else str(value)


def _cut(name: str, text: str) -> str:
    indent = " " * len(name)
    lines = textwrap.wrap(
        text, LETTERS, initial_indent=name, subsequent_indent=indent, max_lines=2, placeholder=" ...",
        break_on_hyphens=False,
    )  # fmt: skip
    return "\n".join(lines)


def _first_line(self: object) -> str:
    return f"<{str(self).partition(chr(10))[0]}>"


def _no_attribute(self: object, name: str) -> NoReturn:
    """Say what draws a result where somebody calls its `plot`: results know nothing of pictures."""
    message = f"{type(self).__name__!r} object has no attribute {name!r}"
    if name == "plot":
        message += f": pictures are functions of results, {_PICTURES.get(type(self).__name__, 'see hs.plot')}"
    raise AttributeError(message)


def _page(self: object) -> str | None:
    """A page with a figure. What draws it knows the results: it is above them, and loaded by its name."""
    page: str | None = importlib.import_module(_NOTEBOOKS).page(self)
    return page


def _bundle(self: object, include: object = None, exclude: object = None) -> dict[str, str]:
    return {"text/plain": str(self)}
