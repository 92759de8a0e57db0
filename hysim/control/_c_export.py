"""The verb `to_c`: a controller as C99 for the device that it runs on.

The numbers are those that the compiled loops get, block by block (`hysim.kernels.tracking`); the code around them is
that of `hysim.control._c_fragments`, and only what this controller needs of it. Sums of many small terms, the
integral and the creep, carry along what rounding takes from them, so that they move in single precision too.
"""

import math
import re
import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from string import Template
from textwrap import wrap
from typing import Literal, NamedTuple

import numpy as np

from hysim._atomic import write_text
from hysim._frozen import FloatArray, frozen
from hysim._release import __version__
from hysim._words import printed, words
from hysim.control import _c_fragments as pieces
from hysim.control._pid import PID
from hysim.control._tracking import TrackingController
from hysim.kernels import boucwen_inverse, inverses
from hysim.kernels import tracking as kernels
from hysim.kernels.stepping import Step

_DIGITS = {"double": 17, "float": 9}
_RANGES = {"double": (2.0**-1022, sys.float_info.max), "float": (2.0**-126, (2.0 - 2.0**-23) * 2.0**127)}
_PID = ("KP", "KI_H", "DERIVATIVE_RATE", "DERIVATIVE_KEPT", "SETPOINT_WEIGHT", "DERIVATIVE_WEIGHT", "UNWINDING")


@printed
@frozen
class CSource:
    """A controller in C99.

    Parameters
    ----------
    name : str
        What its files, types and functions are called.
    header, source : str
        Texts of the header and of the source.
    sketch : str
        Text of an Arduino sketch around them, its pins and scales to be put in.

    Examples
    --------
    >>> import tempfile, hysim as hs
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     hs.to_c(hs.PID(kp=2.0), sample_time=1e-3, name="axis").write(folder)
    """

    name: str
    header: str
    source: str
    sketch: str

    def __str__(self) -> str:
        texts = {".h": self.header, ".c": self.source, ".ino": self.sketch}
        rows = {f"{self.name}{end}": f"{text.count(chr(10))} lines" for end, text in texts.items()}
        return words([f"CSource {self.name}: C99 with math.h alone"], rows)

    def write(self, folder: str | Path) -> None:
        """Write name.h, name.c, and the sketch under the folder's name, as Arduino has it; the folder is made.

        Raises
        ------
        OSError
            If the folder cannot be written to.
        """
        place = Path(folder).resolve()
        place.mkdir(parents=True, exist_ok=True)
        write_text(place / f"{self.name}.h", self.header)
        write_text(place / f"{self.name}.c", self.source)
        write_text(place / f"{place.name}.ino", self.sketch)


def to_c(
    controller: PID | TrackingController,
    sample_time: float,
    *,
    name: str = "controller",
    u0: float = 0.0,
    y0: float = 0.0,
    precision: Literal["double", "float"] = "double",
) -> CSource:
    """A controller as C99 without dependencies: one header, one source.

    Parameters
    ----------
    controller : PID or TrackingController
        Any of its parts; a law to invert must be a Bouc-Wen law with n = 1, or a line.
    sample_time : float
        At which it will be called [s].
    name : str
        Of the files, and in front of each name that they give.
    u0, y0 : float
        Command and displacement at which it starts, at rest [unit of u], [unit of y].
    precision : "double" or "float"
        Of every number in it.

    Returns
    -------
    CSource

    Raises
    ------
    TypeError
        If the controller is of another kind.
    ValueError
        If the law is another one, the name is no name in C, the precision is neither, a number does not fit into
        it, or the sample time is not positive and finite.

    Notes
    -----
    With ``precision="double"``, and compiled without contractions to fused operations, it follows `controller.step`
    to rounding. The state is a struct that the caller holds, so that one source serves several axes.

    Examples
    --------
    >>> import hysim as hs
    >>> code = hs.to_c(hs.PID(kp=2.0, ki=100.0, limits=(0.0, 5.0)), sample_time=1e-3, name="axis")
    >>> [line for line in code.source.splitlines() if "KI_H" in line][0]
    '#define KI_H R(0.10000000000000001)'
    >>> "axis_real axis_step(axis_state *state, axis_real reference, axis_real measurement);" in code.header
    True
    """
    if not isinstance(controller, PID | TrackingController):
        raise TypeError(f"controller must be a PID or a TrackingController, got {type(controller).__name__}")
    if precision not in _DIGITS:
        raise ValueError(f'precision must be "double" or "float", got {precision!r}')
    if not re.fullmatch("[A-Za-z][A-Za-z0-9_]*", name):
        raise ValueError(f"name must be letters, digits and underscores after a letter, got {name!r}")
    if not (math.isfinite(u0) and math.isfinite(y0)):
        raise ValueError(f"u0 and y0 must be finite, got {u0} and {y0}")
    draft = _draft(_composed(controller), sample_time, u0, y0)
    number = _Number(precision)
    texts = {
        "name": name,
        "NAME": name.upper(),
        "version": __version__,
        "type": precision,
        "sample_time": number.bare(sample_time),
        "ahead": str(controller.ahead(sample_time)),
        "u0": f"{u0:g}",
        "y0": f"{y0:g}",
        "fields": "\n".join(f"    {name}_real {place.declaration};" for place in draft.places),
        "period": f"{1e6 * sample_time:.0f}",
    }
    header, source, sketch = (
        Template(text).substitute(texts) for text in (pieces.HEADER, _source(draft, number), pieces.SKETCH)
    )
    return CSource(name=name, header=header, source=source, sketch=sketch)


def _composed(controller: PID | TrackingController) -> TrackingController:
    """A PID alone is a controller of one part, to the bit."""
    if isinstance(controller, TrackingController):
        return controller
    return TrackingController(feedback=replace(controller, limits=None), limits=controller.limits)


class _Place(NamedTuple):
    """In the state: what is there at the start, a number or several."""

    name: str
    start: float | FloatArray

    @property
    def declaration(self) -> str:
        """Name and size."""
        return f"{self.name}[{self.start.size}]" if isinstance(self.start, np.ndarray) else self.name

    def initialised(self, number: "_Number") -> str:
        """What the start gives it."""
        start = self.start
        value = number.braced(start, indent=8) if isinstance(start, np.ndarray) else number.literal(start)
        return f"        .{self.name} = {value},"


@dataclass
class _Draft:
    """What the source is to hold; the parts add to it in the order in which the kernel takes their blocks."""

    parameters: "_Blocks"
    state: "_Blocks"
    constants: dict[str, float | int]
    tables: dict[str, FloatArray]
    places: list[_Place]
    functions: list[str]
    values: list[str]
    body: list[str]


class _Blocks:
    """Blocks of numbers, one behind the other."""

    def __init__(self, numbers: FloatArray) -> None:
        self._numbers, self._taken = numbers, 0

    def take(self, size: int) -> FloatArray:
        """The next block."""
        self._taken += size
        return self._numbers[self._taken - size : self._taken]


class _Number(NamedTuple):
    """Numbers as C has them, in all their digits."""

    precision: str

    def bare(self, value: float | int) -> str:
        """Without what marks the precision."""
        if isinstance(value, int):
            return str(value)
        if math.isinf(value):
            return "INFINITY" if value > 0.0 else "-INFINITY"
        smallest, largest = _RANGES[self.precision]
        if abs(value) > largest:
            raise ValueError(f"the number {value:g} does not fit into a {self.precision}")
        if abs(value) < smallest:
            return "0.0"
        text = f"{value:.{_DIGITS[self.precision]}g}"
        return text if set(text) & set(".e") else text + ".0"

    def literal(self, value: float | int) -> str:
        """As an expression of the precision."""
        text = self.bare(value)
        return text if isinstance(value, int) or "INF" in text else f"R({text})"

    def braced(self, values: FloatArray, indent: int = 0) -> str:
        """As an initialiser of a line that is so far indented."""
        joined = ", ".join(self.literal(value) for value in values.tolist())
        inner = " " * (indent + 4)
        lines = wrap(joined, 112, initial_indent=inner, subsequent_indent=inner, break_on_hyphens=False)
        return "\n".join(["{", *lines, " " * indent + "}"])


def _draft(controller: TrackingController, sample_time: float, u0: float, y0: float) -> _Draft:
    compiled = controller.compiled(sample_time, u0, y0)
    draft = _Draft(_Blocks(compiled.parameters), _Blocks(compiled.state), {}, {}, [], [pieces.CLAMP], [], [])
    head = draft.parameters.take(kernels.N_HEAD)
    command = float(draft.state.take(1)[0])
    forward = controller.feedforward
    draft.constants.update(LOWEST=float(head[0]), HIGHEST=float(head[1]))
    draft.places.append(_Place("command", command))
    feedback = controller.feedback is not None or controller.feedforward is None
    compares = feedback or controller.damping is not None
    follows = compares and controller.model is not None
    if feedback or follows or (forward is not None and forward.creep is not None):
        draft.functions.append(pieces.ACCUMULATE)
    _reference(draft, head, compares and not follows)
    _model(draft, head, follows)
    _feedback(draft, controller, feedback)
    draft.body += ["given = s->command = command;"]
    draft.values.extend(["command", "given", "limited"])
    if forward is not None:
        _feedforward(draft, forward.block(sample_time, u0).inverse, follows)
    draft.body += ["limited = clamp(given, LOWEST, HIGHEST);"]
    if feedback:
        draft.body += [
            "if (limited != given)",
            "    accumulate(&s->integral, &s->integral_carry, UNWINDING * (limited - given));",
        ]
    draft.body += ["return limited;"]
    return draft


def _reference(draft: _Draft, head: FloatArray, targeted: bool) -> None:
    """The reference's filters: what is to be given, and where to be."""
    taps, inverts = int(head[2]), head[3] > 0.0
    drive, target, ring = draft.parameters.take(taps), draft.parameters.take(taps), draft.state.take(taps)
    sums = [("drive", drive, inverts), ("target", target, targeted)]
    draft.values.extend(name for name, _, used in sums if used)
    if taps == 1:
        draft.body.extend(f"{name} = reference;" for name, _, used in sums if used)
        return
    draft.functions.extend([pieces.PUSH, pieces.DOT])
    draft.constants["TAPS"] = taps
    draft.places.append(_Place("references", ring))
    draft.body += ["push(s->references, TAPS, reference);"]
    for name, weights, used in sums:
        if used:
            draft.tables[f"{name}_WEIGHTS".upper()] = weights
            draft.body += [f"{name} = dot({name.upper()}_WEIGHTS, s->references, TAPS);"]


def _model(draft: _Draft, head: FloatArray, follows: bool) -> None:
    """What the feedback compares with."""
    creeping, order, dead, late = (int(number) for number in head[5:9])
    declines, moved = draft.parameters.take(creeping), draft.parameters.take((order - creeping) * order)
    entries, at_samples, within = (draft.parameters.take(size) for size in (3 * order, order + 3, order + 3))
    x, past, readings = draft.state.take(2 * order)[:order], draft.state.take(dead + 3), draft.state.take(late + 2)
    if not follows:
        return
    if not order:
        raise ValueError("the model has no creep and no vibration: leave it out, or give it what it is to follow")
    part = head[9] > 0.0
    draft.constants.update(ORDER=order, CREEPING=creeping, DEAD=dead, LATE=late)
    draft.tables.update(B=entries, OUTPUT=within if part else at_samples)
    draft.tables.update(DECLINES=declines if creeping else np.zeros(1), MOVED=moved if moved.size else np.zeros(1))
    draft.places.extend([_Place("x", x), _Place("x_carry", np.zeros(order)), _Place("past", past)])
    draft.places.append(_Place("readings", readings))
    if pieces.PUSH not in draft.functions:
        draft.functions.append(pieces.PUSH)
    draft.functions.append(_filled(pieces.MODEL, pieces.WITHIN if part else pieces.AT_SAMPLES))
    draft.values.append("target")
    draft.body += ["target = model_reading(s);"]


def _feedback(draft: _Draft, controller: TrackingController, feedback: bool) -> None:
    """PID, notch and damping."""
    numbers, state = draft.parameters.take(9).tolist(), draft.state.take(4).tolist()
    notch, damping, filters = draft.parameters.take(5), draft.parameters.take(5), draft.state.take(4)
    draft.body += ["command = pid(s, target, measurement);" if feedback else "command = R(0.0);"]
    if feedback:
        draft.constants.update(zip(_PID, numbers[:6] + numbers[8:], strict=True))
        draft.functions.append(pieces.PID)
        names = ("integral", "derivative", "seen")
        draft.places.extend(_Place(name, value) for name, value in zip(names, state[1:], strict=True))
        draft.places.append(_Place("integral_carry", 0.0))
    filtered = feedback and controller.notch is not None
    if filtered or controller.damping is not None:
        draft.functions.append(pieces.BIQUAD)
    if filtered:
        draft.tables["NOTCH"] = notch
        draft.places.append(_Place("notch", filters[:2]))
        draft.body += ["command = biquad(NOTCH, s->notch, command);"]
    if controller.damping is not None:
        draft.tables["DAMPING"] = damping
        draft.places.append(_Place("damping", filters[2:]))
        draft.body += ["command += biquad(DAMPING, s->damping, measurement - target);"]
    if not (feedback or controller.damping is not None):
        draft.body += ["(void)measurement;"]


def _feedforward(draft: _Draft, inverse: Step, follows: bool) -> None:
    """The inverse of creep, law and amplifier."""
    gain, offset, number, scale = draft.parameters.take(kernels.N_FEEDFORWARD).tolist()
    elements = int(number)
    weights, declines = draft.parameters.take(elements), draft.parameters.take(elements)
    positions = draft.state.take(elements)
    lowest, highest = draft.parameters.take(inverses.N_LIMITS).tolist()
    draft.constants.update(
        LOWEST_VOLTAGE=lowest, HIGHEST_VOLTAGE=highest, AMPLIFICATION=gain, ZERO=offset, THROUGH=scale
    )
    draft.values.extend(["u", "reached"])
    _law(draft, inverse)
    if elements:
        draft.constants["ELEMENTS"] = elements
        draft.tables.update(WEIGHTS=weights, POSITION_DECLINES=declines)
        draft.places.extend([_Place("positions", positions), _Place("positions_carry", np.zeros(elements))])
        draft.body += [
            "for (i = 0; i < ELEMENTS; i++)",
            "    drive -= WEIGHTS[i] * (s->positions[i] + POSITION_DECLINES[i] * s->positions[i]);",
        ]
    draft.body += ["u = invert(s, drive * THROUGH, &reached);"]
    if elements:
        draft.body += [
            "for (i = 0; i < ELEMENTS; i++)",
            "    accumulate(&s->positions[i], &s->positions_carry[i],",
            "               POSITION_DECLINES[i] * (s->positions[i] - s->level));",
        ]
    draft.body += [
        "s->command += (u - ZERO) / AMPLIFICATION;",
        "given += (reached - ZERO) / AMPLIFICATION;",
    ]
    if follows:
        draft.body += ["move_model(s);"]


def _law(draft: _Draft, inverse: Step) -> None:
    """The inverse of the law."""
    if inverse is inverses.line:
        offset, slope = draft.parameters.take(2).tolist()
        draft.constants.update(OFFSET=offset, SLOPE=slope)
        draft.places.append(_Place("level", 0.0))
        draft.functions.append(pieces.LINE)
        return
    if inverse is not boucwen_inverse.step:
        raise ValueError("the law has no inverse in C: it must be a Bouc-Wen law with n = 1, or a line")
    rising, A, beta, gamma, n, gain, offset, degree = draft.parameters.take(boucwen_inverse.N_HEAD).tolist()
    if n != 1.0:
        raise ValueError(f"the law has no inverse in C: n must be 1, got {n:g}")
    loading = {"K_LOADING": beta + gamma, "K_UNLOADING": beta - gamma}
    draft.constants.update(RISING=rising, A=A, **loading, GAIN=gain, OFFSET=offset, DEGREE=int(degree))
    draft.tables["COEFFICIENTS"] = draft.parameters.take(int(degree))
    _, level, _, _, u, z = draft.state.take(boucwen_inverse.N_OWN + 2).tolist()
    draft.places.extend([_Place("level", level), _Place("law_u", u), _Place("law_z", z)])
    draft.functions.append(pieces.BOUC_WEN)


def _source(draft: _Draft, number: _Number) -> str:
    """The text of the source, the controller's name still open."""
    defines = [f"#define {name} {number.literal(value)}" for name, value in draft.constants.items()]
    tables = [f"static const real {name}[] = {number.braced(values)};" for name, values in draft.tables.items()]
    rest = [place.initialised(number) for place in draft.places if np.any(place.start) or place.name == "command"]
    body = [
        f"real {', '.join(dict.fromkeys(draft.values))};",
        *(["int i;"] if "ELEMENTS" in draft.constants else []),
        "",
    ]
    return "\n".join(
        [
            pieces.PRELUDE + pieces.MACROS[number.precision],
            "\n".join([*defines, ""]),
            *([table + "\n" for table in tables]),
            *draft.functions,
            _filled(pieces.START, {"@rest": "\n".join(rest)}),
            _filled(pieces.STEP, {"@body": "\n".join(f"    {line}".rstrip() for line in [*body, *draft.body])}),
        ]
    )


def _filled(piece: str, parts: Mapping[str, str]) -> str:
    for mark, text in parts.items():
        piece = piece.replace(mark, text)
    return piece
