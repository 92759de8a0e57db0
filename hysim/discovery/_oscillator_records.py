"""How the records of an oscillator were made, and what of an oscillator is known."""

from collections.abc import Mapping, Sequence

import numpy as np

from hysim._frozen import FloatArray
from hysim.discovery._memory_terms import SYMMETRIES
from hysim.models.oscillator import BoucWenOscillator
from hysim.models.oscillator_structure import OscillatorStructure
from hysim.records import Record

_REPEATS = 1e-3  # of the input's rms: how nearly a period must repeat itself to be seen
_TRANSIENT = 1.5  # rms of what changes from period to period, early in the period over late


def recorded(record: Record) -> OscillatorStructure:
    """How a record was probably made; see `hysim.discovery._oscillator.oscillator`.

    Parameters
    ----------
    record : Record
        With an even time.

    Returns
    -------
    OscillatorStructure
    """
    period = _period(record.u)
    if period is None or not _is_steady(record.y, period):
        return BoucWenOscillator.structure()
    return BoucWenOscillator.structure(initial="periodic", period=period, hold="band-limited")


def checked(
    records: Sequence[Record],
    structure: OscillatorStructure | None,
    degree: int,
    symmetry: str,
) -> OscillatorStructure:
    """Refuse arguments that no oscillator can be found with; how the records were made."""
    if not isinstance(records, Sequence) or not all(isinstance(record, Record) for record in records) or not records:
        raise TypeError(f"oscillator takes a sequence of records, got {type(records).__name__}")
    if degree not in (1, 2, 3):
        raise ValueError(f"degree must be 1, 2 or 3, got {degree!r}")
    if symmetry not in SYMMETRIES:
        raise ValueError(f"symmetry must be one of {', '.join(SYMMETRIES)}, got {symmetry!r}")
    if structure is None:
        made = {recorded(record) for record in records}
        if len(made) > 1:
            raise ValueError("the records were not all made alike: say how by structure=, or find on each of them")
        return made.pop()
    if not isinstance(structure, OscillatorStructure):
        raise TypeError(f"structure comes from BoucWenOscillator.structure(...), got {type(structure).__name__}")
    if structure.excitation != "force":
        raise ValueError('the input must be a force: structure(excitation="force")')
    return structure


def known_plant(given: Mapping[str, float | None]) -> dict[str, float]:
    """The parts of the plant that are given.

    Raises
    ------
    ValueError
        If a number is not finite, or the mass is not positive.
    TypeError
        If it is no number, such as text.
    """
    for name, value in given.items():
        if value is not None and (isinstance(value, bool) or not isinstance(value, (int, float, np.number))):
            raise TypeError(f"{name} must be a number, got {value!r}")
    known = {name: float(value) for name, value in given.items() if value is not None}
    for name, value in known.items():
        if not np.isfinite(value):
            raise ValueError(f"{name} must be finite, got {value}")
    if known.get("mass", 1.0) <= 0.0:
        raise ValueError(f"mass must be positive, got {known['mass']}")
    return known


def _period(u: FloatArray) -> int | None:
    """The smallest shift, up to half of the record, by which an input repeats itself."""
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
    left = int(np.argmax(differences > 0.5 * (n - shifts) * squares[n] / n))  # where the input has left its beginning
    repeats[:left] = False
    return int(shifts[np.argmax(repeats)]) if repeats.any() else None


def _is_steady(y: FloatArray, period: int) -> bool:
    """Whether what changes between the first and the last period is no transient, which would be larger at first."""
    first, last = y[:period], y[y.size // period * period - period : y.size // period * period]
    early, late = (float(np.std(part)) for part in np.array_split(first - last, 4)[::3])
    return early <= max(_TRANSIENT * late, 1e-6 * float(np.std(y)))
