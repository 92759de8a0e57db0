"""The verb `parameter_curve`: an identified parameter against its channel, with standard errors."""

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, frozen
from hysim._printing import printed, quantity, summary_text
from hysim.identification._result import Identification
from hysim.identification.json_forms import Stored
from hysim.models.dependent import Dependent
from hysim.models.varying import ChannelPolynomial, power_coefficients, weights

_LEVEL = 0.95


@printed
@frozen
class ParameterCurve(Stored):
    """An identified parameter as a polynomial of its channel.

    Parameters
    ----------
    polynomial : ChannelPolynomial
        The polynomial, by its values at places of the channel.
    covariance : array, shape (n_places, n_places)
        Covariance of these values; nan where the data do not determine them.
    reach : float
        Half an interval at 95 % in standard errors, by Student's t.
    """

    json_name = "parameter curve"

    polynomial: ChannelPolynomial
    covariance: FloatArray
    reach: float

    @property
    def coefficients(self) -> tuple[float, ...]:
        """Coefficients of the powers 0, 1, ... of the channel."""
        return self.polynomial.coefficients

    @property
    def coefficients_stderr(self) -> tuple[float, ...]:
        """Their standard errors."""
        rows = power_coefficients(self.polynomial.at).T
        return tuple(_roots(rows, self.covariance).tolist())

    def value(self, channel: npt.ArrayLike) -> FloatArray:
        """Value of the parameter at values of the channel, of the same shape."""
        return self.polynomial.value(channel)

    def stderr(self, channel: npt.ArrayLike) -> FloatArray:
        """Standard error of the parameter at values of the channel, of the same shape."""
        return _roots(weights(self.polynomial.at, channel), self.covariance)

    def band(self, channel: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Ends of the interval at 95 % at values of the channel, of the same shape each; it holds at each value alone.

        Outside the identified range the band is that of the polynomial, which is all that it knows.
        """
        middle, half = self.value(channel), self.reach * self.stderr(channel)
        return middle - half, middle + half

    def __str__(self) -> str:
        known = self.polynomial
        low, high = known.span
        return summary_text(
            [f"{known.parameter} of degree {known.degree} in {known.channel}, {quantity(low)} to {quantity(high)}"],
            {
                f"{known.channel} = {place:.6g}": f"{float(self.value(place)):.6g} +- {float(self.stderr(place)):.2g}"
                for place in known.at
            },
        )


def parameter_curve(fit: Identification, parameter: str) -> ParameterCurve:
    """The polynomial that a parameter was identified as, with its uncertainty.

    Parameters
    ----------
    fit : Identification
        A result of `hysim.identify` with `depends`.
    parameter : str
        A parameter that depends on a channel.

    Returns
    -------
    ParameterCurve
        Its values, band and coefficients; the covariance is that of the linearised model, whatever the method of the
        fit's intervals.

    Raises
    ------
    TypeError
        If the model of the fit does not depend on channels.
    ValueError
        If the parameter does not.

    Examples
    --------
    >>> import hysim as hs
    >>> u = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=40)
    >>> recs = [hs.Record(u=u, y=T * hs.Play(threshold=0.2).response(u), channels={"T": T}) for T in (1.0, 2.0, 4.0)]
    >>> curve = hs.parameter_curve(hs.identify(hs.Play, recs, depends={"gain": ("T", 1)}), "gain")
    >>> round(float(curve.value(3.0)), 6), [round(c, 6) + 0.0 for c in curve.coefficients]
    (3.0, [0.0, 1.0])
    """
    from scipy.stats import t

    if not isinstance(fit, Identification) or not isinstance(fit.model, Dependent):
        kind = type(fit.model if isinstance(fit, Identification) else fit).__name__
        raise TypeError(f"parameter_curve takes a result of identify with depends=, got one of a {kind}")
    known = {each.parameter: each for each in fit.model.polynomials}
    if parameter not in known:
        raise ValueError(f"{parameter!r} depends on no channel; those that do are {', '.join(known)}")
    names = known[parameter].names
    places = [fit.free_names.index(name) for name in names if name in fit.free_names]
    covariance = np.zeros((len(names), len(names)))
    if len(places) == len(names):
        covariance = fit.covariance[np.ix_(places, places)]
    freedom = fit.residual.size - fit.n_parameters
    reach = float(t.ppf(0.5 + 0.5 * _LEVEL, freedom)) if freedom > 0 else float("nan")
    return ParameterCurve(polynomial=known[parameter], covariance=covariance, reach=reach)


def _roots(rows: FloatArray, covariance: FloatArray) -> FloatArray:
    """Standard errors of the combinations `rows` (..., n_places) of the values."""
    variance = np.einsum("...i,ij,...j->...", rows, covariance, rows)
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))
