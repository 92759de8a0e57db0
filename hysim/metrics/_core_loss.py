"""Measures of models of core loss: Steinmetz's equation, its generalisation to any waveform, and errors over sequences.

    P = k f^alpha B^beta                                                    a sine of amplitude B
    P = 1/T sum_j D_j^(beta - alpha) integral_j k_i |dB/dt|^alpha dt        any cycle of period T
    k_i = k / ((2 pi)^(alpha - 1) 2^(beta - alpha) integral_0^2pi |cos|^alpha)

The second is the improved generalised Steinmetz equation (iGSE); for a sine it is the first. A cycle is split into
loops j of span D_j: one between its extremes, and a minor loop for each reversal between them, which begins where B
turns and ends where B returns to this level. Minor loops inside it are split off likewise. B is linear between its
samples, so that the integrals and the ends of loops are exact. Sources: C. P. Steinmetz, Trans. AIEE 9 (1892) 1; K.
Venkatachalam, C. R. Sullivan, T. Abdallah, H. Tacca, Accurate prediction of ferrite core loss with nonsinusoidal
waveforms using only Steinmetz parameters, IEEE Workshop on Computers in Power Electronics (2002) 36.

Errors of the field y over the flux density u, of a sequence or of each row of several, by the MagNet Challenge 2:

    sequence relative error = rms(e) / rms(y),    e = y_model - y
    energy error            = sum_k (e_k + e_(k+1)) / 2 (u_(k+1) - u_k) / |loss|

Source: Test/Error_Distribution_Plot_Template.m of github.com/minjiechen/magnetchallenge-2 (2026).
"""

import math
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, Positive, check_not_negative, check_positive, checked, read_only
from hysim._columns.turning import TOLERANCE, turns


@checked
class Steinmetz:
    """Core loss by Steinmetz's equation ``k f^alpha B^beta``, and by the iGSE for other waveforms.

    It knows neither a bias of the flux density, nor the temperature, nor that a ferrite relaxes after a ramp.

    Parameters
    ----------
    k : float
        Loss density at 1 Hz and 1 T, positive [W/m^3].
    alpha, beta : float
        Exponents of the frequency and of the amplitude, positive [1].

    Examples
    --------
    >>> import hysim as hs
    >>> ferrite = hs.Steinmetz(k=1.5, alpha=1.4, beta=2.5)
    >>> B = hs.signals.triangle(-0.1, 0.1, cycles=1, samples_per_cycle=20)
    >>> round(float(ferrite.loss(100e3, 0.1))), round(ferrite.loss_of(B, sample_time=0.5e-6))
    (47434, 44215)
    """

    k: Positive
    alpha: Positive
    beta: Positive

    @classmethod
    def from_losses(cls, frequency: npt.ArrayLike, amplitude: npt.ArrayLike, loss: npt.ArrayLike) -> "Steinmetz":
        """The equation of least squares in the logarithms of loss densities under sines.

        Parameters
        ----------
        frequency, amplitude, loss : array
            Frequency [Hz], amplitude of the flux density [T] and loss density [W/m^3], of shapes that broadcast.

        Raises
        ------
        ValueError
            If a number is not positive and finite, or the frequencies and amplitudes do not determine both exponents.

        Examples
        --------
        >>> import hysim as hs
        >>> f, B = [50.0, 100.0], [[0.5], [1.0]]
        >>> hs.Steinmetz.from_losses(f, B, [[50.0, 200.0], [200.0, 800.0]]).loss(400.0, 1.0).round(6).item()
        12800.0
        """
        arrays = {"frequency": frequency, "amplitude": amplitude, "loss": loss}
        columns = [read_only(values, name) for name, values in arrays.items()]
        check_positive(**{name: float(each.min(initial=math.inf)) for name, each in zip(arrays, columns, strict=True)})
        f, B, P = (np.log(column).ravel() for column in np.broadcast_arrays(*columns))
        (ln_k, alpha, beta), _, rank, _ = np.linalg.lstsq(np.column_stack([np.ones(f.size), f, B]), P)
        if rank < 3:
            raise ValueError("k, alpha and beta need losses at two frequencies and, at one of them, two amplitudes")
        return cls(k=math.exp(ln_k), alpha=float(alpha), beta=float(beta))

    def loss(self, frequency: npt.ArrayLike, amplitude: npt.ArrayLike) -> FloatArray:
        """Loss density under sines of a frequency [Hz] and an amplitude [T], of shapes that broadcast [W/m^3]."""
        f, B = read_only(frequency, "frequency"), read_only(amplitude, "amplitude")
        check_not_negative(frequency=f.min(initial=0.0), amplitude=B.min(initial=0.0))
        return self.k * f**self.alpha * B**self.beta

    def loss_of(self, B: npt.ArrayLike, sample_time: float) -> float:
        """Loss density under a period of any waveform, by the iGSE with minor loops [W/m^3].

        `B` (n,) is the flux density [T] in one period whose last sample is the first one again, as in `hysim.signals`,
        every `sample_time` [s]. Noise in it is a multitude of steep minor loops: smooth a measured waveform before.
        Raises ValueError if B is not finite, its first and last sample differ by more than 1 % of its span, it has
        fewer than 3 samples, or the sample time is not positive.
        """
        samples = read_only(B, "B", ndim=1)
        check_positive(sample_time=sample_time)
        if samples.size < 3 or abs(samples[-1] - samples[0]) > TOLERANCE * np.ptp(samples):
            raise ValueError("B must be one period that ends where it begins: append its first sample, B[0], to it")
        lowest = np.argmin(samples[:-1])
        period = np.append(np.roll(samples[:-1], -lowest), samples[lowest])
        integral = np.append(0.0, np.cumsum((np.abs(np.diff(period)) / sample_time) ** self.alpha * sample_time))
        difference = self.beta - self.alpha
        total = sum(span**difference * part for span, part in _loops(period, integral))
        cosine = 2.0 * math.sqrt(math.pi) * math.gamma(0.5 * (self.alpha + 1.0)) / math.gamma(0.5 * self.alpha + 1.0)
        k_i = self.k / ((2.0 * math.pi) ** (self.alpha - 1.0) * 2.0**difference * cosine)
        return float(k_i * total / ((samples.size - 1) * sample_time))


def _loops(B: FloatArray, integral: FloatArray) -> Iterator[tuple[float, float]]:
    """Span of each loop of a period from its lowest sample on, and the part of a running integral that it contains."""
    levels, parts = [float(B[0])], list[float]()  # where B has turned in loops that are open, and what lies between
    for branch in turns(B, 0.0).branches:
        b, running = B[branch], integral[branch]
        order = slice(None) if b[-1] > b[0] else slice(None, None, -1)
        before, begin, end = 0.0, float(running[0]), float(b[-1])
        while len(levels) > 2 and abs(end - levels[-1]) >= abs(levels[-1] - levels[-2]):
            closed = float(np.interp(levels[-2], b[order], running[order]))
            yield abs(levels[-1] - levels[-2]), parts.pop() + before + closed - begin
            before, begin = parts.pop(), closed
            del levels[-2:]
        parts.append(before + float(running[-1]) - begin)
        levels.append(end)
    if parts:
        yield float(np.ptp(B)), sum(parts)


def sequence_relative_error(y: npt.ArrayLike, y_model: npt.ArrayLike) -> float | FloatArray:
    """Root mean square of the error over that of y, for one sequence or each row; nan where y is zero throughout.

    It is the sequence relative error of the MagNet Challenge 2, as a fraction: the challenge prints it in percent.

    Parameters
    ----------
    y, y_model : array, shape (n,) or (n_sequences, n)
        Outputs in the predicted part of the sequences, without samples that the model was told [unit of y].

    Returns
    -------
    float, or array, shape (n_sequences,)

    Raises
    ------
    ValueError
        If shapes differ, a value is not finite, or there are fewer than 2 samples.

    Examples
    --------
    >>> sequence_relative_error([[3.0, 4.0], [1.0, 1.0]], [[3.0, 4.5], [1.0, 1.0]]).tolist()
    [0.1, 0.0]
    """
    measured, model = _sequences(y=y, y_model=y_model)
    return _relative(np.sqrt(np.mean((model - measured) ** 2, axis=-1)), np.sqrt(np.mean(measured**2, axis=-1)))


def normalised_energy_error(
    u: npt.ArrayLike, y: npt.ArrayLike, y_model: npt.ArrayLike, *, loss: npt.ArrayLike | None = None
) -> float | FloatArray:
    """Error of the integral of y du over its measured size, for one sequence or each row; nan where that is zero.

    It is the normalised energy error of the MagNet Challenge 2, as a fraction and with its sign, positive where the
    model's energy is larger; the challenge prints percents of its magnitude, over the loss of the whole sequence that
    comes with the data: pass that as `loss`. Without it short parts have larger errors.

    Parameters
    ----------
    u, y, y_model : array, shape (n,) or (n_sequences, n)
        Flux density [unit of u], and measured and modelled field [unit of y], in the predicted part of the sequences.
    loss : float or array, shape (n_sequences,), optional
        Measured energy, of any sign; by default the integral of y du over these samples [unit of y times unit of u].

    Returns
    -------
    float, or array, shape (n_sequences,)

    Raises
    ------
    ValueError
        If shapes differ, a value is not finite, or there are fewer than 2 samples.

    Examples
    --------
    >>> u, y = [0.0, 1.0, 0.0], [0.0, 2.0, -2.0]
    >>> float(normalised_energy_error(u, y, [0.0, 2.0, -1.0])), float(normalised_energy_error(u, y, y, loss=4.0))
    (-0.5, 0.0)
    """
    inputs, measured, model = _sequences(u=u, y=y, y_model=y_model)
    energy, energy_model = (np.sum(0.5 * (f[..., 1:] + f[..., :-1]) * np.diff(inputs), -1) for f in (measured, model))
    scale = energy if loss is None else read_only(loss, "loss")
    if np.ndim(scale) and np.shape(scale) != np.shape(energy):
        raise ValueError(f"loss must be one number, or one for each sequence, got shape {np.shape(scale)}")
    return _relative(energy_model - energy, np.abs(scale))


def _sequences(**values: npt.ArrayLike) -> list[FloatArray]:
    arrays = [read_only(each, name) for name, each in values.items()]
    shapes = [array.shape for array in arrays]
    if len(shapes[0]) not in (1, 2) or shapes[0][-1] < 2 or len({*shapes}) > 1:
        raise ValueError(f"{', '.join(values)} must share a shape (n,) or (n_sequences, n), n at least 2, got {shapes}")
    return arrays


def _relative(error: FloatArray, scale: FloatArray) -> float | FloatArray:
    ratio = np.full_like(error, math.nan)
    return np.divide(error, scale, where=scale > 0.0, out=ratio)[()]
