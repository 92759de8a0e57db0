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

The terms themselves give a disc too, often a wider one. Let P be the polynomial of the terms up to the index k. They
are the first terms of the integral of f(P), so that the residual P' - f(P) is what f(P) has left from the power k on.
Where P, at complex distances up to X, stays where f is known to be analytic, and spread bounds f there, Cauchy's
estimate holds for f(P) as it did for v'. So the integral of the residual over a step of theta X is at most the tail
above, with X in place of the radius; it is the error of the step, times the factor by which the flow parts neighbours,
at most one where the memory decays, and of order one over a part of the radius where it grows. How far P goes is
bounded by the sum of the sizes of its terms, abs(t_1) X + abs(t_2) X^2 + ...

A family gives the domain and spread. A step is cut to a length at which the tail after N_TERMS is rounding beside the
memory, and a series ends as soon as its tail is. Where the rates are small beside the decay, as in saturation, the
radius grows as the logarithm of their ratio, so that the bound costs little there.

Source: Cauchy's method of majorants, as in E. Hille, Ordinary Differential Equations in the Complex Domain (1976),
chapter 2.
"""

import math

from hysim.kernels._compile import inner

N_TERMS = 24
ROUNDING = 2.0**-54
FARTHEST = 0.75  # of the radius: the terms of a series fall off by a quarter at least


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
    room = ROUNDING * size * (1.0 - FARTHEST) * (N_TERMS + 1.0)
    if room >= spread:
        return FARTHEST
    return float(min(FARTHEST, (room / spread) ** (1.0 / (N_TERMS + 1.0))))
