"""Core loss over amplitude, frequency and bias of the flux density, and over channels such as the temperature.

    energy(A, f, b, ...) = integral of H dB over a cycle of B = b + A w(f t)    [J/m^3]
    loss = f energy                                                             [W/m^3]

of the steady cycle of a model with the input B and the output H. B is linear between its samples. H of a `Dashpot` or
an `ExcessLoss` is then constant between them, and its integral exact; the integral of other parts of a sum is by the
trapezoidal rule. A law without time is brought to its steady cycle by the turning points of B alone, which leave the
memory of the whole cycle, and by one whole cycle: driven by B, some laws need 10 000.
"""

import itertools
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, check_positive, read_only
from hysim._basics.printing import aligned, extent, frozen_result, summary_text
from hysim._basics.results import model_of
from hysim._columns.turning import turns
from hysim.errors import SimulationError
from hysim.laws.dashpot import RatePart
from hysim.models.dependent import Dependent
from hysim.models.parts import check_parts, response_of
from hysim.models.protocols import needs_time
from hysim.models.sum import Sum
from hysim.signals import sine

_SAMPLES = 1000  # of a cycle: its polygon misses 3.3e-6 of the eddy current loss under a sine
_CYCLES, _LONGEST = [4**k for k in range(2, 11)], 2**21  # cycles before the measured one, and their most samples
_STEADY = 1e-8  # of the span: largest change of H during half of these cycles, and of B in one


@frozen_result
class LossMap:
    """Result of `hysim.loss_map`: core loss over amplitude, frequency, bias and channels.

    Parameters
    ----------
    amplitudes, frequencies, bias : array
        Amplitudes [T], frequencies [Hz] and means [T] of the flux density.
    channels : mapping
        Name of each channel to its values.
    energy : array, shape (n_amplitudes, n_frequencies, n_bias, ...)
        Loss per cycle, with an axis for each channel behind the others [J/m^3].
    """

    amplitudes: FloatArray
    frequencies: FloatArray
    bias: FloatArray
    channels: Mapping[str, FloatArray]
    energy: FloatArray

    @property
    def loss(self) -> FloatArray:
        """Loss density, of the shape of `energy` [W/m^3]."""
        return np.asarray(np.einsum("af...,f->af...", self.energy, self.frequencies))

    def __str__(self) -> str:
        table = [["B [T]", *(f"{f:.4g} Hz" for f in self.frequencies)]]
        first = self.loss.reshape(*self.energy.shape[:2], -1)[..., 0]
        table += [[f"{a:.4g}", *(f"{loss:.4g}" for loss in row)] for a, row in zip(self.amplitudes, first, strict=True)]
        place = ", ".join(f"{name} = {extent(at)}" for name, at in {"bias [T]": self.bias, **self.channels}.items())
        return summary_text([f"LossMap [W/m^3]: {place}", *aligned(table)])


def loss_map(
    model: Any,
    amplitudes: npt.ArrayLike,
    frequencies: npt.ArrayLike,
    *,
    bias: npt.ArrayLike = (0.0,),
    channels: Mapping[str, npt.ArrayLike] | None = None,
    waveform: npt.ArrayLike | None = None,
) -> LossMap:
    """Core loss of a model from the flux density B to the field H, over a grid of amplitudes and frequencies.

    Each loss is that of the steady cycle: the model begins with its own memory, and the cycle is repeated until H
    repeats. Most laws of cores lead from H to B. Their static field is their inverse, which
    `hysim.PrandtlIshlinskii.inverse` and `hysim.BoucWen.inverse` return as a model; for other laws, give an object with
    a method ``response(B)`` that returns ``law.inverse_response(B)``.

    Parameters
    ----------
    model : model or result of a fit
        From B [T] to H [A/m]: a law, a `hysim.Sum` with `hysim.Dashpot` and `hysim.ExcessLoss`, or a `hysim.Dependent`
        of such a model.
    amplitudes, frequencies, bias : array, shape (n_amplitudes,), (n_frequencies,), (n_bias,)
        Positive amplitudes of B, by which the waveform is multiplied [T]; positive frequencies of the cycle [Hz]; and
        values that are added to the waveform [T].
    channels : mapping, optional
        Each channel of a `hysim.Dependent` model to values (n,).
    waveform : array, shape (n,), optional
        One cycle of amplitude 1 and bias 0, both ends included; by default a sine of 1000 samples.

    Returns
    -------
    LossMap

    Raises
    ------
    TypeError, ValueError, SimulationError
        If the model has no response, or channels are given to one that is not a `hysim.Dependent`; if an amplitude or a
        frequency is not positive, a number is not finite, the waveform does not end where it begins, a channel is
        missing or unknown, every loss is negative, as of a model from H to B, or the field diverges or does not repeat.

    Examples
    --------
    >>> import hysim as hs
    >>> core = hs.MaxwellSlip(stiffness=(40.0, 20.0), slips=(0.1, 0.3)) + hs.Dashpot(c=0.02)
    >>> print(hs.loss_map(core, [0.5, 1.0], [50.0, 100.0]))
    LossMap [W/m^3]: bias [T] = 0
    B [T]  50 Hz  100 Hz
    0.5    806.7    2107
    1       2547    7068
    """
    (model,) = check_parts((model_of(model),), "model")
    grid = {"amplitudes": amplitudes, "frequencies": frequencies, "bias": bias}
    swings, rates, means = (read_only(np.atleast_1d(values), name, ndim=1) for name, values in grid.items())
    others = {name: read_only(np.atleast_1d(values), name, ndim=1) for name, values in (channels or {}).items()}
    if not all(each.size for each in (swings, rates, means, *others.values())):
        raise ValueError("loss_map needs an amplitude, a frequency and a bias, and a value of each channel")
    check_positive(amplitudes=swings.min(initial=math.inf), frequencies=rates.min(initial=math.inf))
    if others and not isinstance(model, Dependent):
        raise TypeError(f"a {type(model).__name__} depends on no channel: give a hysim.Dependent, or no channels")
    samples = sine(1.0, cycles=1, samples_per_cycle=_SAMPLES) if waveform is None else waveform
    wave = read_only(samples, "waveform", ndim=1)
    if wave.size < 3 or not abs(wave[-1] - wave[0]) < _STEADY * np.ptp(wave):
        raise ValueError("waveform must be one cycle that ends where it begins: append its first sample to it")
    if abs(np.abs(wave).max() - 1.0) > 0.01:  # by hand: samples may miss the extrema
        raise ValueError("waveform must have the amplitude 1: take its mean off, which is the bias, and divide it")
    energies = []
    for point in itertools.product(*(each.tolist() for each in others.values())):
        law = model.at(**dict(zip(others, point, strict=True))) if isinstance(model, Dependent) else model
        cycles = itertools.product(swings, rates, means)
        energies += [_energy(law, b + a * wave, 1.0 / (f * (wave.size - 1))) for a, f, b in cycles]
    shape = [each.size for each in (*others.values(), swings, rates, means)]
    energy = np.moveaxis(np.reshape(energies, shape), [-3, -2, -1], [0, 1, 2])
    if energy.max(initial=-math.inf) < 0.0:
        raise ValueError("every loss is negative, as of a model from H to B: give one from B to H, as law.inverse() is")
    return LossMap(amplitudes=swings, frequencies=rates, bias=means, channels=others, energy=energy)


def _energy(model: Any, cycle: FloatArray, sample_time: float) -> float:
    if isinstance(model, Sum):
        return sum(_energy(part, cycle, sample_time) for part in model.parts)
    period = cycle[:-1] if needs_time(model) else cycle[[first for first, _ in turns(cycle, 0.0).plateaus[:-1]]]
    for cycles in (each for each in _CYCLES if 0 < each * period.size <= _LONGEST):
        path = np.concatenate([np.tile(period, cycles), cycle[:-1], cycle])
        H = response_of(model, path, sample_time)
        field, earlier = H[-cycle.size :], H[: cycles * period.size].reshape(cycles, -1)
        if np.abs(earlier[-1] - earlier[cycles // 2]).max() <= _STEADY * np.ptp(field):
            means = field[1:] if isinstance(model, RatePart) else 0.5 * (field[1:] + field[:-1])
            return float(means @ np.diff(cycle))
    raise SimulationError(f"the field does not come to repeat under B from {cycle.min():g} to {cycle.max():g} T")
