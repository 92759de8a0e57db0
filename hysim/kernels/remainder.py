"""A bound on what a power series leaves out: a radius of convergence and the size of the terms not computed.

Small last terms prove nothing: the terms of a series may vanish to rounding for a while and then grow, beside a bell
that lies further on, or near a memory of zero. So every step by a power series here is shown to converge before it is
taken. With x the distance from the point of expansion, the equation is

    dv/dx = f(v, x),    v(0) = 0

with f analytic where |v| < r and |x| < R are complex numbers, and |f - f(0, 0)| <= spread there. Then

1. by Schwarz's lemma, |f - f(0, 0)| <= spread max(|v| / r, |x| / R);
2. so along each ray the size of v in units of r grows no faster than Y' = start + growth Y, Y(0) = 0, where
   growth = spread / r and start = max(|f(0, 0)| / r, 1 / R); until Y = 1 the solution stays inside, and is analytic.
   The length up to there is `radius`;
3. by Cauchy's estimate for v' = f on that disc, term k + 1 of v at the fraction `theta` of the radius is at most
   spread radius theta^(k + 1) / (k + 1), and all terms after the one with the index k together at most

    tail = spread radius theta^(k + 1) / ((k + 1) (1 - theta)).

A family gives r, R and spread; a step is cut to the fraction of the radius at which the tail after N_TERMS is
rounding, and its series ends as soon as the tail is. Where the rates are small beside the decay, as in saturation,
the radius grows as the logarithm of their ratio, so that the bound costs little there.

Source: Cauchy's method of majorants, as in E. Hille, Ordinary Differential Equations in the Complex Domain (1976),
chapter 2.
"""

import math

from hysim.kernels._compile import inner

N_TERMS = 24
ROUNDING = 2.0**-54
_FARTHEST = 0.75  # of the radius: the terms of a series fall off by a quarter at least


@inner
def radius(start: float, growth: float) -> float:
    """Length on which Y' = start + growth Y, from zero, stays below one, or a little less; `start` is positive."""
    ratio = growth / start
    return 2.0 / (2.0 * start + growth) if ratio < 0.5 else math.log1p(ratio) / growth


@inner
def fraction(spread: float, size: float) -> float:
    """Largest fraction theta of a radius at which the tail after N_TERMS is rounding beside `size`.

    `spread` is the product of spread and radius in the bound of the tail.
    """
    room = ROUNDING * size * (1.0 - _FARTHEST) * (N_TERMS + 1.0)
    if room >= spread:
        return _FARTHEST
    return min(_FARTHEST, (room / spread) ** (1.0 / (N_TERMS + 1.0)))
