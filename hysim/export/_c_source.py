"""The verb `to_c`: a law, a plant or a controller as C99 for the device that it runs on."""

import math
import re
import tomllib
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from hysim._basics.atomic import write_all
from hysim._basics.frozen import FloatArray
from hysim._basics.printing import frozen_result, summary_text
from hysim._basics.release import __version__
from hysim._basics.results import model_of
from hysim.errors import warn_unsafe
from hysim.export import _c
from hysim.export._program import Program, lacks_inverse, program_of, start_of

_FOLDER = Path(__file__).with_name("c")  # templates
_FEW = 16  # places of a state that are set one by one


@frozen_result
class CSource:
    """A law, a plant or a controller in C99.

    Parameters
    ----------
    name : str
        Name of its files, types and functions.
    header, source : str
        Texts of the header and of the source.
    main : str
        Text of a program around them that reads inputs from its standard input and prints outputs.
    state_size : int
        Number of doubles in the state.

    Examples
    --------
    >>> import tempfile, hysim as hs
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     hs.to_c(hs.PID(kp=2.0), sample_time=1e-3, name="axis").write(folder)
    """

    name: str
    header: str
    source: str
    main: str
    state_size: int

    @property
    def _files(self) -> dict[str, str]:
        return {f"{self.name}.h": self.header, f"{self.name}.c": self.source, f"{self.name}_main.c": self.main}

    def __str__(self) -> str:
        rows = {name: f"{text.count(chr(10))} lines" for name, text in self._files.items()}
        title = f"CSource {self.name}: C99 with math.h alone, a state of {8 * self.state_size} bytes"
        return summary_text([title], rows)

    def write(self, folder: str | Path) -> None:
        """Write name.h, name.c and name_main.c into a folder, which is made."""
        place = Path(folder).resolve()
        place.mkdir(parents=True, exist_ok=True)
        write_all({place / name: text for name, text in self._files.items()})


def to_c(
    thing: Any,
    sample_time: float | None = None,
    *,
    name: str = "model",
    u0: float | None = None,
    y0: float | None = None,
) -> CSource:
    """A law, a plant or a controller as C99 without dependencies: one header, one source, and a worked `main`.

    The functions are translated from those that Python compiles; compiled without contractions to fused operations, the
    numbers agree to 1e-12 of the range, and to the bit where both C libraries do.

    Parameters
    ----------
    thing : model, result of a fit, or controller
        A law, sum, cascade, plant or actuator, `InverseFeedforward` for the inverse of a law, or another controller.
        Laws of your own take part; their step is translated from its Python source.
    sample_time : float, optional
        Time between two samples [s]; a law that does not depend on time needs none.
    name : str
        Name of the files, and prefix of every public name in them; no keyword, function or header of C.
    u0, y0 : float, optional
        Command and displacement at which a controller starts at rest [units of u and y]. By default the command at
        which its law's memory holds, which of an identified law is the first input of its record, and the displacement
        of its model there; else 0. Laws and plants without an input of their own get their first input where they run.

    Returns
    -------
    CSource

    Raises
    ------
    TypeError, ValueError
        If the thing cannot be stepped; if the name is no name in C, the sample time is not positive and finite, or
        missing where one is needed, or a step uses Python that is not translated, with its file and line.

    Examples
    --------
    >>> import hysim as hs
    >>> code = hs.to_c(hs.PID(kp=2.0, ki=100.0, limits=(0.0, 5.0)), sample_time=1e-3, name="axis")
    >>> "double axis_step(axis_state *state, double reference, double measurement);" in code.header
    True
    """
    if reason := _refusal(name):
        raise ValueError(f"name must be letters, digits and underscores after a letter, got {name!r}: {reason}")
    warn_unsafe(thing)
    thing = model_of(thing)
    program = program_of(thing, sample_time, u0=u0, y0=y0)
    if u0 is not None and program.inputs == ("u",):
        raise ValueError(f"a {type(thing).__name__} begins at the u0 of its law: u0 is for controllers and inverses")
    texts = _texts(program, name, type(thing).__name__, *start_of(thing, sample_time or math.inf, u0, y0))
    texts["lacks"] = f"\n   WARNING: {lacks}." if (lacks := lacks_inverse(thing)) else ""
    templates = (Template((_FOLDER / file).read_text(encoding="utf-8")) for file in ("model.h", "model.c", "main.c"))
    header, source, main = (template.substitute(texts) for template in templates)
    return CSource(name=name, header=header, source=source, main=main, state_size=program.state.size)


def _refusal(name: str) -> str:
    """Why a name cannot be that of files and functions in C; empty for one that can."""
    if not re.fullmatch("[A-Za-z][A-Za-z0-9_]*", name):
        return "it has another character"
    if name in _c.RESERVED:
        return "it is a word of the language C"
    if name in _c.MATHEMATICS | _c.TESTS:
        return "it is a function of the C library"
    return f"{name}.h is a header of the C library" if name.lower() in _c.HEADERS else ""


def _texts(program: Program, name: str, kind: str, u0: float, y0: float) -> dict[str, str]:
    upper, is_model, is_timed = name.upper(), program.inputs == ("u",), math.isfinite(program.sample_time)
    defines = [f"#define {upper}_SAMPLE_TIME {program.sample_time!r} /* s */\n"] * is_timed
    defines += [f"#define {upper}_AHEAD {program.ahead} /* samples of the reference */\n"] * (not is_model)
    n_state, has_start = program.state.size, bool(program.start)
    texts = {"name": name, "NAME": upper, "kind": kind, "u0": f"{u0:g}", "y0": f"{y0:g}", "version": __version__}
    texts |= {"n_state": str(n_state), "last": str(n_state - 1), "count": str(len(program.inputs))}
    texts |= {"first": ", double u0" * has_start, "begin": ", u" * has_start, "output": f"the {program.output}"}
    texts |= {
        "when": f"every {upper}_SAMPLE_TIME seconds" if is_timed else "for each sample of the input",
        "defines": "".join(defines),
        "arguments": ", ".join(f"double {each}" for each in program.inputs),
        "inputs": ", ".join(program.inputs),
        "functions": program.source,
        "table": _c.table("parameters", program.parameters.tolist()),
        "init": _init(program.state, has_start),
        "formats": " ".join(["%lf"] * len(program.inputs)),
        "places": ", ".join(f"&{each}" for each in program.inputs),
    }
    words = tomllib.loads((_FOLDER / "texts.toml").read_text(encoding="utf-8"))["model" if is_model else "controller"]
    words |= {"begun": "The first sample will be `u0`."} if has_start else {}
    return texts | {name: Template(text).substitute(texts) for name, text in words.items()}


def _init(state: FloatArray, has_start: bool) -> str:
    places = np.flatnonzero((state != 0.0) | np.signbit(state))
    loop = f"    for (int k = 0; k < {state.size}; k++)\n        state->x[k] = "
    if places.size <= _FEW:
        lines = [f"{loop}0.0;\n", *(f"    state->x[{k}] = {_c.number(state[k])};\n" for k in places.tolist())]
    else:
        lines = ["    " + _c.table("initial", state.tolist()).replace("\n", "\n    ") + f"\n\n{loop}initial[k];\n"]
    return "".join([*lines, *["    start(parameters, state->x, u0);\n"] * has_start])
