"""The verb `to_c`: a controller as C99 for the device that it runs on.

The numbers are those of the compiled loops, block by block (`hysim.kernels.tracking`); the code around them comes from
`hysim.control._c_fragments`, as far as this controller needs it. Sums of many small terms, the integral and the creep,
carry their rounding errors along, so that they move in single precision too.
"""

import math
import re
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from string import Template
from textwrap import wrap
from typing import Literal, NamedTuple

import numpy as np

from hysim._atomic import write_text
from hysim._frozen import FloatArray, frozen
from hysim._printing import printed, summary_text
from hysim._release import __version__
from hysim.control import _c_fragments as pieces
from hysim.control._feedforward import InverseFeedforward
from hysim.control._pid import PID
from hysim.control._tracking import TrackingController
from hysim.kernels import boucwen_inverse, inverses
from hysim.kernels import tracking as kernels
from hysim.kernels.stepping import Step

Exported = PID | TrackingController | InverseFeedforward

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
        Of its files, types and functions.
    header, source : str
        Texts of the header and of the source.
    sketch : str
        Text of an Arduino sketch around them, with placeholders for pins and scales.

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
        return summary_text([f"CSource {self.name}: C99 with math.h alone"], rows)

    def write(self, folder: str | Path) -> None:
        """Write name.h, name.c and the sketch, which Arduino wants under the folder's name; the folder is made."""
        place = Path(folder).resolve()
        place.mkdir(parents=True, exist_ok=True)
        write_text(place / f"{self.name}.h", self.header)
        write_text(place / f"{self.name}.c", self.source)
        write_text(place / f"{place.name}.ino", self.sketch)


def to_c(
    controller: Exported,
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
    controller : PID, TrackingController or InverseFeedforward
        With any of its parts; a law to invert must be a Bouc-Wen law with n = 1, or a line.
    sample_time : float
        At which it will be called [s].
    name : str
        Of the files, and the prefix of every name in them.
    u0, y0 : float
        Command and displacement at which it starts, at rest [unit of u], [unit of y].
    precision : "double" or "float"
        Of every number in it.

    Returns
    -------
    CSource

    Raises
    ------
    TypeError, ValueError
        If the controller or its law is another one, the name is no name in C, the precision is neither, a number does
        not fit into it, or the sample time is not positive and finite.

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
    if not isinstance(controller, Exported):
        raise TypeError(
            f"controller must be a PID, a TrackingController or an InverseFeedforward, got {type(controller).__name__}"
        )
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
        "fields": "\n".join(
            f"    {name}_real {place}{f'[{start.size}]' if isinstance(start, np.ndarray) else ''};"
            for place, start in draft.places.items()
        ),
        "period": f"{1e6 * sample_time:.0f}",
    }
    header, source, sketch = (
        Template(text).substitute(texts) for text in (pieces.HEADER, _source(draft, number), pieces.SKETCH)
    )
    return CSource(name=name, header=header, source=source, sketch=sketch)


def _composed(controller: Exported) -> TrackingController:
    """A PID or a feed-forward alone as a controller of one part, which has the same bits."""
    if isinstance(controller, TrackingController):
        return controller
    if isinstance(controller, InverseFeedforward):
        return TrackingController(feedforward=controller)
    return TrackingController(feedback=replace(controller, limits=None), limits=controller.limits)


class _Blocks:
    """Blocks of numbers, one behind the other."""

    def __init__(self, numbers: FloatArray) -> None:
        self._numbers, self._taken = numbers, 0

    def take(self, size: int) -> FloatArray:
        """The next block."""
        self._taken += size
        return self._numbers[self._taken - size : self._taken]


@dataclass
class _Draft:
    """Parts of the source; they are added in the order in which the kernel takes their blocks.

    `places` are the state's, by name, with the number or the array at the start.
    """

    parameters: _Blocks
    state: _Blocks
    constants: dict[str, float | int]
    tables: dict[str, FloatArray] = field(default_factory=dict)
    places: dict[str, float | FloatArray] = field(default_factory=dict)
    functions: list[str] = field(default_factory=lambda: [pieces.CLAMP])
    values: list[str] = field(default_factory=list)
    body: list[str] = field(default_factory=list)


class _Number(NamedTuple):
    """Numbers in C, with all their digits."""

    precision: str

    def bare(self, value: float | int) -> str:
        """Without the mark of the precision."""
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
        """As an initialiser on a line with this indent."""
        joined = ", ".join(self.literal(value) for value in values.tolist())
        inner = " " * (indent + 4)
        lines = wrap(joined, 112, initial_indent=inner, subsequent_indent=inner, break_on_hyphens=False)
        return "\n".join(["{", *lines, " " * indent + "}"])


def _draft(controller: TrackingController, sample_time: float, u0: float, y0: float) -> _Draft:
    compiled, forward = controller.compiled(sample_time, u0, y0), controller.feedforward
    parameters, state = _Blocks(compiled.parameters), _Blocks(compiled.state)
    head, command = parameters.take(kernels.N_HEAD), state.take(1)
    draft = _Draft(parameters, state, {"LOWEST": float(head[0]), "HIGHEST": float(head[1])})
    draft.places["command"] = float(command[0])
    feedback = controller.feedback is not None or forward is None
    compares = feedback or controller.damping is not None
    follows = compares and controller.model is not None
    if feedback or follows or (forward is not None and forward.creep is not None):
        draft.functions.append(pieces.ACCUMULATE)
    _reference(draft, head, compares and not follows)
    _model(draft, head, follows)
    _feedback(draft, controller, feedback)
    draft.body.append("given = s->command = command;")
    draft.values += ["command", "given", "limited"]
    if forward is not None:
        _feedforward(draft, forward.block(sample_time, u0).inverse, follows)
    draft.body.append("limited = clamp(given, LOWEST, HIGHEST);")
    if feedback:
        draft.body += pieces.UNWIND
    draft.body.append("return limited;")
    return draft


def _reference(draft: _Draft, head: FloatArray, targeted: bool) -> None:
    """Filters of the reference: for the feed-forward, and for the feedback."""
    taps = int(head[2])
    sums = {"drive": draft.parameters.take(taps), "target": draft.parameters.take(taps)}
    ring, used = draft.state.take(taps), {"drive": head[3] > 0.0, "target": targeted}
    names = [name for name in sums if used[name]]
    draft.values += names
    if taps == 1:
        draft.body += [f"{name} = reference;" for name in names]
        return
    draft.functions += [pieces.PUSH, pieces.DOT]
    draft.constants["TAPS"] = taps
    draft.places["references"] = ring
    draft.tables.update({f"{name.upper()}_WEIGHTS": sums[name] for name in names})
    draft.body.append("push(s->references, TAPS, reference);")
    draft.body += [f"{name} = dot({name.upper()}_WEIGHTS, s->references, TAPS);" for name in names]


def _model(draft: _Draft, head: FloatArray, follows: bool) -> None:
    """The model with which the feedback compares."""
    creeping, order, dead, late = (int(number) for number in head[5:9])
    declines, others = draft.parameters.take(creeping), draft.parameters.take((order - creeping) * order)
    entries, at_samples, within = (draft.parameters.take(size) for size in (3 * order, order + 3, order + 3))
    x, past, readings = draft.state.take(2 * order)[:order], draft.state.take(dead + 3), draft.state.take(late + 2)
    if not follows:
        return
    if not order:
        raise ValueError("the model has no creep and no vibration: leave it out, or give it what it is to follow")
    part = head[9] > 0.0
    draft.constants.update(ORDER=order, CREEPING=creeping, DEAD=dead, LATE=late)
    draft.tables.update(B=entries, OUTPUT=within if part else at_samples)
    draft.tables.update(DECLINES=declines if creeping else np.zeros(1), MOVED=others if others.size else np.zeros(1))
    draft.places.update(x=x, x_carry=np.zeros(order), past=past, readings=readings)
    draft.functions += [pieces.PUSH, _filled(pieces.MODEL, pieces.WITHIN if part else pieces.AT_SAMPLES)]
    draft.values.append("target")
    draft.body.append("target = model_reading(s);")


def _feedback(draft: _Draft, controller: TrackingController, feedback: bool) -> None:
    """PID, notch and damping."""
    numbers, state = draft.parameters.take(9).tolist(), draft.state.take(4).tolist()
    notch, damping, filters = draft.parameters.take(5), draft.parameters.take(5), draft.state.take(4)
    draft.body.append("command = pid(s, target, measurement);" if feedback else "command = R(0.0);")
    if feedback:
        draft.constants.update(zip(_PID, numbers[:6] + numbers[8:], strict=True))
        draft.functions.append(pieces.PID)
        draft.places.update(integral=state[1], derivative=state[2], seen=state[3], integral_carry=0.0)
    filtered, damped = feedback and controller.notch is not None, controller.damping is not None
    if filtered or damped:
        draft.functions.append(pieces.BIQUAD)
    if filtered:
        draft.tables["NOTCH"], draft.places["notch"] = notch, filters[:2]
        draft.body.append("command = biquad(NOTCH, s->notch, command);")
    if damped:
        draft.tables["DAMPING"], draft.places["damping"] = damping, filters[2:]
        draft.body.append("command += biquad(DAMPING, s->damping, measurement - target);")
    if not (feedback or damped):
        draft.body.append("(void)measurement;")


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
    draft.values += ["u", "reached"]
    _law(draft, inverse)
    if elements:
        draft.constants["ELEMENTS"] = elements
        draft.tables.update(WEIGHTS=weights, POSITION_DECLINES=declines)
        draft.places.update(positions=positions, positions_carry=np.zeros(elements))
    draft.body += pieces.CREEP_INVERTED if elements else pieces.INVERTED
    if follows:
        draft.body.append("move_model(s);")


def _law(draft: _Draft, inverse: Step) -> None:
    """The inverse of the law."""
    if inverse is inverses.line:
        offset, slope = draft.parameters.take(2).tolist()
        draft.constants.update(OFFSET=offset, SLOPE=slope)
        draft.places["level"] = 0.0
        draft.functions.append(pieces.LINE)
        return
    if inverse not in (boucwen_inverse.step, boucwen_inverse.elementary_step):
        raise ValueError("the law has no inverse in C: it must be a Bouc-Wen law with n = 1, or a line")
    rising, A, beta, gamma, n, gain, offset, degree = draft.parameters.take(boucwen_inverse.N_HEAD).tolist()
    if n != 1.0:
        raise ValueError(f"the law has no inverse in C: n must be 1, got {n:g}")
    draft.constants.update(RISING=rising, A=A, K_LOADING=beta + gamma, K_UNLOADING=beta - gamma)
    draft.constants.update(GAIN=gain, OFFSET=offset, DEGREE=int(degree))
    draft.tables["COEFFICIENTS"] = draft.parameters.take(int(degree))
    _, level, _, _, u, z = draft.state.take(boucwen_inverse.N_OWN + 2).tolist()
    draft.places.update(level=level, law_u=u, law_z=z)
    draft.functions.append(pieces.BOUC_WEN)


def _source(draft: _Draft, number: _Number) -> str:
    """The text of the source, with $name for the controller's."""
    defines = [f"#define {name} {number.literal(value)}" for name, value in draft.constants.items()]
    tables = [f"static const real {name}[] = {number.braced(values)};\n" for name, values in draft.tables.items()]
    rest = [
        f"        .{name} = {number.braced(start, 8) if isinstance(start, np.ndarray) else number.literal(start)},"
        for name, start in draft.places.items()
        if np.any(start) or name == "command"
    ]
    index = ["int i;"] if "ELEMENTS" in draft.constants else []
    body = [f"real {', '.join(dict.fromkeys(draft.values))};", *index, "", *draft.body]
    return "\n".join(
        [
            pieces.PRELUDE + pieces.MACROS[number.precision],
            "\n".join([*defines, ""]),
            *tables,
            *dict.fromkeys(draft.functions),
            _filled(pieces.START, {"@rest": "\n".join(rest)}),
            _filled(pieces.STEP, {"@body": "\n".join(f"    {line}".rstrip() for line in body)}),
        ]
    )


def _filled(piece: str, parts: Mapping[str, str]) -> str:
    for mark, text in parts.items():
        piece = piece.replace(mark, text)
    return piece
