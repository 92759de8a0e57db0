"""The anhysteretic curve of a grain of many moments, m(x) = <w>, and its slope.

Each moment has a cosine w, -1 <= w <= 1, to the field, with the density exp(x w + p w^2): x is the field in units of a
parameter a, and p the energy of the anisotropy in units of the thermal one.

    m(x) = int w exp(x w + p w^2) dw / int exp(x w + p w^2) dw,    dm/dx = <w^2> - <w>^2

p = 0 is Langevin's function coth x - 1/x. p > 0 is an easy axis along the field, for p to infinity m = tanh x; p < 0 is
a hard one, for p to -infinity a straight line that ends in saturation at x = -2 p. Ramesh, Jiles and Roderick have the
integrals over an angle, with an easy axis at the angle psi to the field, averaged over both sides of it; with
w = cos(theta) the mean of their two exponents is this one, and p = K cos(2 psi) / (mu0 Ms a). The slope is never
negative, highest at x = 0, and falls with |x|.

In the complex plane m has its poles where the second integral vanishes: for p = 0 at i pi, 2 i pi, ...; for p > 0 on
the imaginary axis from i pi / 2 on (theorem of Lee and Yang); for p < 0 farther than pi from the real axis.
"""

import math

import numpy as np

from hysim._basics.frozen import read_only
from hysim.kernels._compile import inner
from hysim.kernels.elementary import riccati_series, sum16

_DEPTH = 40.0  # of the exponent: what is left out is below e^-40 of the integral
_SERIES = read_only(riccati_series(3))  # L(x) / x in powers of x^2, from L' = 1 - L^2 - 2 L / x
_SERIES_REACH = 1.0  # the terms left out are below 3e-17 of the sum here
_N_ANGLES = 32
_ANGLES, _WEIGHTS = (read_only(0.5 * values) for values in np.polynomial.legendre.leggauss(_N_ANGLES))


@inner
def curve(x: float, p: float) -> tuple[float, float]:
    """m(x) and its slope for the anisotropy p."""
    if p != 0.0:
        return aligned(x, p)
    return langevin(x)


@inner
def langevin(x: float) -> tuple[float, float]:
    """coth x - 1/x and its slope."""
    y = abs(x)
    if y < _SERIES_REACH:
        ratio = sum16(_SERIES, 0, x * x)
        m = x * ratio
        return m, 1.0 - m * m - 2.0 * ratio
    decay = math.exp(-2.0 * y)
    apart = 1.0 - decay
    m = (1.0 + decay) / apart - 1.0 / y
    slope = 1.0 / (y * y) - 4.0 * decay / (apart * apart)
    return math.copysign(m, x), slope


@inner
def aligned(x: float, p: float) -> tuple[float, float]:
    """m(x) and its slope for p other than 0, by Gauss' rule on the cosines that matter.

    The exponent falls by _DEPTH on at most two stretches of cosines; 32 points on each leave out less than a rounding.
    """
    y = abs(x)
    top, first, last = stretches(y, p)
    highest = top * (y + p * top)
    zeroth, one, two = 0.0, 0.0, 0.0
    for side in range(2):
        low, high = (first, top) if side == 0 else (top, last)
        length = high - low
        if length > 0.0:
            for j in range(_N_ANGLES):
                w = low + length * (0.5 + _ANGLES[j])
                share = length * _WEIGHTS[j] * math.exp(w * (y + p * w) - highest)
                opposite = math.exp(-2.0 * y * w)
                zeroth += share * (1.0 + opposite)
                one += share * w * -math.expm1(-2.0 * y * w)
                two += share * w * w * (1.0 + opposite)
    m = one / zeroth
    return math.copysign(m, x), max(0.0, two / zeroth - m * m)


@inner
def stretches(y: float, p: float) -> tuple[float, float, float]:
    """Cosine of the highest exponent for y >= 0, and the lowest and highest that matter, all from 0 to 1."""
    if p < 0.0 and y < -2.0 * p:
        top, reach = -0.5 * y / p, math.sqrt(-_DEPTH / p)
        return top, max(0.0, top - reach), min(1.0, top + reach)
    rise = y + 2.0 * p
    square = rise * rise - 4.0 * _DEPTH * p
    reach = 2.0 * _DEPTH / (rise + math.sqrt(square)) if square > 0.0 and rise > 0.0 else 1.0
    return 1.0, max(0.0, 1.0 - reach), 1.0


@inner
def field_of(m: float, p: float) -> float:
    """The x with m(x) = m for ``|m| < 1``, by Newton's method inside a bracket; infinite from 1 on."""
    wanted = abs(m)
    if wanted >= 1.0:
        return math.copysign(math.inf, m)
    low, high = 0.0, math.inf
    x = wanted * (3.0 - wanted * wanted) / (1.0 - wanted * wanted)
    for _ in range(200):
        value, slope = curve(x, p)
        low, high = (x, high) if value < wanted else (low, x)
        trial = x + (wanted - value) / slope if slope > 0.0 else math.nan
        if not low <= trial <= high:
            trial = 0.5 * (low + high) if high < math.inf else 2.0 * x
        if abs(trial - x) <= 4.0e-16 * x or abs(wanted - value) <= 1.2e-16 * wanted:
            break
        x = trial
    return math.copysign(x, m)
