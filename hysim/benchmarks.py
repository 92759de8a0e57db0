"""Public benchmarks, generated anew.

The Bouc-Wen system-identification benchmark of J. P. Noel and M. Schoukens (2016) is the oscillator

    m y'' + c y' + k y + z = u,    z' = alpha y' - beta (gamma |y'| z + delta y' |z|)

with u in N and y in m; in hysim's symbols A = alpha, beta -> beta gamma, gamma -> beta delta, n = 1. Its published
records, at 750 Hz, are not the solution of this equation but the result of a recipe, which is repeated here:

    integration   Newmark's constant average acceleration with the trapezoidal rule for z at 15 kHz, from rest
    multisine     8192 samples a period, the lines 5.035 to 150.055 Hz with equal amplitudes and random phases;
                  a published period comes to 15 kHz by its spectrum
    sweep         40 sin(2 pi (18 t + t^2 / 12)) N, made at 15 kHz
    decimation    31-tap Hamming filters, both ends continued by their point mirror images, without delay: by
                  2, 2 and 5 for the multisine, by 20 at once for the sweep

An exact integration at 15 kHz differs from it by 1e-7 m (multisine) and 2e-6 m (sweep).
"""

import operator
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, check_choice, check_finite, check_not_negative, read_only
from hysim.laws.differential.boucwen import BoucWen
from hysim.plants.oscillator import BoucWenOscillator
from hysim.plants.oscillator_structure import decimated, interpolated
from hysim.records import Record
from hysim.signals import multisine

__all__ = ["LINES", "PERIOD", "SAMPLE_RATE", "SWEEP_LENGTH"]
__all__ += ["noel_schoukens", "noel_schoukens_plant", "simulate_official"]


def __dir__() -> list[str]:
    return __all__


SAMPLE_RATE = 750.0
PERIOD = 8192
SWEEP_LENGTH = 153_000
LINES = np.arange(55, 1640)
LINES.setflags(write=False)

_OVERSAMPLING = 20
_STAGES = {"multisine": (2, 2, 5), "sweep": (20,)}
_LEVELS = {"multisine": 50.0, "sweep": 40.0}
_UNITS = {"t": "s", "u": "N", "y": "m"}


def noel_schoukens_plant() -> BoucWenOscillator:
    """Return the benchmark's oscillator, with the integration step of its data when sampled at 15 kHz.

    Returns
    -------
    BoucWenOscillator
        ``method="newmark"`` with one step a sample: the recipe. For the solution of the equation itself
        take the same with another method, by `dataclasses.replace`.

    Examples
    --------
    >>> import hysim as hs
    >>> round(hs.benchmarks.noel_schoukens_plant().natural_frequency / 6.283185307, 2)
    35.59
    """
    law = BoucWen(A=5e4, beta=800.0, gamma=-1100.0)
    return BoucWenOscillator(mass=2.0, damping=10.0, stiffness=5e4, law=law, method="newmark", substeps=1)


def noel_schoukens(
    kind: str = "multisine",
    *,
    level: float | None = None,
    seed: int = 0,
    periods: int = 5,
    initial: str = "periodic",
    noise: float = 0.0,
) -> Record:
    """Generate a record of the Bouc-Wen benchmark.

    Parameters
    ----------
    kind : {"multisine", "sweep"}
        A multisine from 5 to 150 Hz with random phases, or the sine sweep from 18 to 52 Hz.
    level : float, optional
        Root mean square of the multisine, by default 50 N, or amplitude of the sweep, by default 40 N.
    seed : int
        Seed of the phases and of the noise.
    periods : int
        Number of periods of the multisine.
    initial : {"periodic", "rest"}
        Start of a multisine's record: a period after rest (transient below 1e-12), or at rest. Sweeps begin at rest.
    noise : float
        Root mean square of white Gaussian noise up to 375 Hz, added to the output at 15 kHz, different in each
        period [m]; the filters pass 92 % of it. The benchmark's training noise is 8e-6.

    Returns
    -------
    Record
        At 750 Hz: ``periods * 8192`` samples, or 153 000 of the sweep.

    Raises
    ------
    ValueError
        If an option is unknown, the level or the noise is negative or not finite, or periods is below 1.
    SimulationError
        If a level is so high that the motion diverges.

    Examples
    --------
    >>> import hysim as hs
    >>> train = hs.benchmarks.noel_schoukens(seed=1, periods=2, noise=8e-6)
    >>> len(train), round(float(train.u.std()), 6), train.units["y"]
    (16384, 50.0, 'm')
    """
    check_choice("kind", kind, _STAGES)
    check_choice("initial", initial, ("periodic", "rest"))
    if operator.index(periods) < 1:
        raise ValueError(f"periods must be at least 1, got {periods}")
    level = _LEVELS[kind] if level is None else level
    check_not_negative(level=level, noise=noise)
    check_finite(level=level, noise=noise)
    phases, disturbances = np.random.default_rng(seed).spawn(2)
    if kind == "sweep":
        force = level * _unit_sweep(SWEEP_LENGTH)
        lead, n_samples = 0, SWEEP_LENGTH
    else:
        lead, n_samples = PERIOD * (initial == "periodic"), PERIOD * periods
        period = multisine(LINES, rms=1.0, samples_per_period=_OVERSAMPLING * PERIOD, seed=phases)
        force = np.tile(level * period, periods + 1 + (initial == "periodic"))
    y = noel_schoukens_plant().response(force, 1.0 / (SAMPLE_RATE * _OVERSAMPLING))
    if noise > 0.0:
        # white to 375 Hz, root mean square 1, independent from period to period
        length = PERIOD if y.size % (_OVERSAMPLING * PERIOD) == 0 else y.size // _OVERSAMPLING
        blocks = disturbances.standard_normal((y.size // (_OVERSAMPLING * length), length))
        y += noise * np.concatenate([interpolated(block, _OVERSAMPLING) for block in blocks])
    u, y = (each[lead : lead + n_samples] for each in (force[::_OVERSAMPLING], decimated(y, _STAGES[kind])))
    return Record(u=u, y=y, t=np.arange(n_samples) / SAMPLE_RATE, units=_UNITS, name=f"Noel-Schoukens {kind}")


def simulate_official(
    u: npt.ArrayLike, *, kind: str = "multisine", plant: BoucWenOscillator | None = None
) -> FloatArray:
    """Published output of the benchmark for one of its inputs, to 1e-12 m.

    Parameters
    ----------
    u : array, shape (n,) [N]
        Published input at 750 Hz: one period of a multisine, of any even length, or the sweep or its beginning.
    kind : {"multisine", "sweep"}
        A multisine is periodic: of three periods from rest the second is returned. A sweep is computed from its
        formula, which agrees with its published samples to 1e-10.
    plant : BoucWenOscillator, optional
        Another plant, such as an identified one, to simulate by the same recipe, from rest; its method, steps and
        initial state are ignored.

    Returns
    -------
    array, shape (n,) [m]

    Raises
    ------
    ValueError
        If the kind is unknown, u is not finite or has not one axis, a period has an odd or too small number
        of samples, or the sweep's samples are not those of its formula.

    Examples
    --------
    >>> import hysim as hs
    >>> rec = hs.benchmarks.noel_schoukens(seed=2, periods=1)
    >>> bool(abs(hs.benchmarks.simulate_official(rec.u) - rec.y).max() < 1e-12)
    True
    """
    check_choice("kind", kind, _STAGES)
    inputs = read_only(u, "u", ndim=1)
    if kind == "sweep":
        force = _LEVELS["sweep"] * _unit_sweep(inputs.size)
        deviation = np.abs(force[::_OVERSAMPLING] - inputs)
        if inputs.size < 2 or deviation.max() > 1e-6:
            place = f", got {inputs[deviation.argmax()]} at sample {deviation.argmax()}" if inputs.size else ""
            raise ValueError(f"u must hold the published sweep, 40 sin(2 pi (18 t + t^2/12)) at 750 Hz{place}")
        begin = 0
    else:
        if inputs.size < 32 or inputs.size % 2:
            raise ValueError(f"u must hold one period, an even number of samples from 32 on, got {inputs.size}")
        force, begin = np.tile(interpolated(inputs, _OVERSAMPLING), 3), inputs.size
    plant = plant or noel_schoukens_plant()
    recipe = replace(plant, method="newmark", substeps=1, initial_state=(), law=replace(plant.law, z0=0.0))
    y = recipe.response(force, 1.0 / (SAMPLE_RATE * _OVERSAMPLING))
    return decimated(y, _STAGES[kind])[begin : begin + inputs.size]


def _unit_sweep(n_samples: int) -> FloatArray:
    """The sweep at 15 kHz, amplitude 1, as long as `n_samples` at 750 Hz."""
    t = np.arange(_OVERSAMPLING * n_samples) / (_OVERSAMPLING * SAMPLE_RATE)
    return np.asarray(np.sin(2.0 * np.pi * (18.0 * t + t**2 / 12.0)))
