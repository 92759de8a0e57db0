"""The verb `discover_oscillator`: its arguments; `hysim.discovery._oscillator_search` has the search."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from hysim._frozen import FloatArray, check_positive
from hysim._progress import Reports, reports
from hysim.discovery._oscillator_response import Response
from hysim.discovery._oscillator_search import Search
from hysim.discovery._result import OscillatorDiscovery
from hysim.laws.differential.terms import RELAXATION, Term, memory_terms, symmetric
from hysim.plants.oscillator import BoucWenOscillator
from hysim.plants.oscillator_structure import OscillatorStructure
from hysim.records import Record, several

_REPEATS = 1e-3  # of the input's rms: largest difference of two periods that count as alike
_TRANSIENT = 1.5  # rms of what changes from period to period, early in the period over late


@reports
def discover_oscillator(
    record_or_records: Record | Sequence[Record],
    *,
    structure: OscillatorStructure | None = None,
    mass: float | None = None,
    damping: float | None = None,
    stiffness: float | None = None,
    degree: int = 3,
    symmetry: str | None = None,
    seed: int = 0,
    progress: Reports = None,
) -> OscillatorDiscovery:
    """Discover the law of the memory in a mass on a hysteretic spring, ``m y'' + c y' + k y + z = u``.

    Plant and law are found together, from force u and displacement y. Bouc-Wen laws, a linear relaxation and laws of
    other terms are refined by the error of the simulated oscillator; the one of lowest BIC is taken.

    Parameters
    ----------
    record_or_records : Record or sequence of Record
        Force, displacement and time, evenly spaced; all of one plant. They must hold several swings, large enough for
        the memory to be curved: only its curvature distinguishes A from k.
    structure : OscillatorStructure, optional
        How the records were made, from ``BoucWenOscillator.structure(...)``. By default a record is taken as steady if
        its input repeats itself and its periods are alike, otherwise as beginning at rest.
    mass, damping, stiffness : float, optional
        Known parts of the plant [u per unit of y''; y'; y].
    degree : {1, 2, 3}
        Highest power of z in the library of terms.
    symmetry : {None, "odd"}
        ``"odd"`` leaves out terms that do not change their sign with u and z.
    seed : int
        Seed of the resampling behind `OscillatorDiscovery.inclusion`.
    progress : callable or False, optional
        Called as ``progress(done, total)``.
        By default calls beyond 2 s report on the standard error; False turns this off.

    Returns
    -------
    OscillatorDiscovery

    Raises
    ------
    ValueError
        If a record has no even time, is too short, has a constant signal or is not that of a mass on springs, or an
        option is unknown.
    TypeError
        If the first argument is not a record or a sequence of them, `structure` is not one, or a part of the plant is
        no number.

    Examples
    --------
    >>> import numpy as np
    >>> import hysim as hs
    >>> law = hs.BoucWen(A=5e4, beta=800.0, gamma=-300.0)
    >>> plant = hs.BoucWenOscillator(mass=2.0, damping=10.0, stiffness=5e4, law=law)
    >>> t = np.arange(300) / 750
    >>> u = 60 * np.sin(2 * np.pi * (20 + 40 * t) * t)
    >>> dis = hs.discover_oscillator(hs.Record(u=u, y=hs.simulate(plant, t, u).y, t=t))
    >>> {term: round(value) for term, value in dis.coefficients.items()}
    {"u'": 50000, "|u'| z": -800, "u' |z|": 300}
    """
    records = several(record_or_records, "discover_oscillator")
    library = _library(degree, symmetry)
    known = _known_plant({"mass": mass, "damping": damping, "stiffness": stiffness})
    chosen = _structure(records, structure)
    others = () if structure is not None or chosen.period is None else (replace(chosen, hold="foh"),)
    search = Search(Response(chosen, records, known), library, seed, progress or (lambda done, total: None))
    return search.result(others)


def recorded(record: Record) -> OscillatorStructure:
    """How a record with an even time was probably made; see `discover_oscillator`."""
    period = _period(record.u)
    if period is None or not _is_steady(record.y, period):
        return BoucWenOscillator.structure()
    return BoucWenOscillator.structure(initial="periodic", period=period, hold="band-limited")


def _library(degree: int, symmetry: str | None) -> tuple[Term, ...]:
    """The terms by their power of z, without combinations of earlier ones."""
    if degree not in (1, 2, 3):
        raise ValueError(f"degree must be 1, 2 or 3, got {degree!r}")
    if symmetry not in (None, "odd"):
        raise ValueError(f'symmetry must be None or "odd", got {symmetry!r}')
    ordered = sorted(memory_terms(degree), key=lambda term: (term.degree, term.is_even_in_memory, term.rectified))
    return symmetric((*ordered, RELAXATION), symmetry)


def _structure(records: Sequence[Record], structure: OscillatorStructure | None) -> OscillatorStructure:
    if structure is None:
        made = {recorded(record) for record in records}
        if len(made) > 1:
            raise ValueError("the records were made in different ways: give structure=, or one record at a time")
        return made.pop()
    if not isinstance(structure, OscillatorStructure):
        raise TypeError(f"structure comes from BoucWenOscillator.structure(...), got {type(structure).__name__}")
    if structure.excitation != "force":
        raise ValueError('the input must be a force: structure(excitation="force")')
    return structure


def _known_plant(plant: Mapping[str, float | None]) -> dict[str, float]:
    known = {}
    for name, value in plant.items():
        if value is None:
            continue
        if isinstance(value, bool) or not isinstance(value, (int, float, np.number)):
            raise TypeError(f"{name} must be a number, got {value!r}")
        if not np.isfinite(value):
            raise ValueError(f"{name} must be finite, got {value}")
        known[name] = float(value)
    check_positive(mass=known.get("mass"))
    return known


def _period(u: FloatArray) -> int | None:
    """Smallest shift, up to half of the record, by which an input repeats itself."""
    n = u.size
    if np.ptp(u) == 0.0:
        return None
    centred = u - u.mean()
    squares = np.concatenate([[0.0], np.cumsum(centred**2)])
    shifts = np.arange(1, n // 2 + 1)
    spectrum = np.fft.rfft(centred, 2 * n)
    products = np.fft.irfft(np.abs(spectrum) ** 2, 2 * n)[shifts]
    differences = squares[n - shifts] + squares[n] - squares[shifts] - 2.0 * products
    repeats = differences <= _REPEATS**2 * (n - shifts) * squares[n] / n
    first_unlike = int(np.argmax(differences > 0.5 * (n - shifts) * squares[n] / n))
    repeats[:first_unlike] = False
    return int(shifts[np.argmax(repeats)]) if repeats.any() else None


def _is_steady(y: FloatArray, period: int) -> bool:
    first, last = y[:period], y[y.size // period * period - period : y.size // period * period]
    early, late = (float(np.std(part)) for part in np.array_split(first - last, 4)[::3])
    return early <= max(_TRANSIENT * late, 1e-6 * float(np.std(y)))
