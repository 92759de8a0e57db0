"""The law of Vaiana and Rosati: an exponential approach to one limiting curve for each direction.

Along a monotone input that begins at (u_P, f_P) and moves in the direction s, with the numbers of this direction,

    f(u)   = c_s(u) - (c_s(u_P) - f_P) exp(-alpha |u - u_P|)
    c_s(u) = k_b u + s f_0 + beta_1 (exp(beta_2 u) - 1) + 4 gamma_1 / (1 + exp(-gamma_2 (u - gamma_3))) - 2 gamma_1

The first paper writes the second term of f as -s exp(-alpha s (u - u_j)) / alpha, by a history variable

    u_j = u_P + (s / alpha) log(s alpha (c_s(u_P) - f_P))

which exists where f_P is on the inner side of the curve, s (c_s(u_P) - f_P) > 0. Both agree, since u_j says that
s exp(alpha s (u_j - u_P)) / alpha = c_s(u_P) - f_P. Without u_j, f may begin anywhere.

The step adds to f_P what c_s gains on the stroke and what f gains on c_s. Both are products, not differences of large
numbers, so that f keeps its digits where a stroke is short, or a curve is a straight line in disguise. The terms of
gamma are 2 gamma_1 tanh(gamma_2 (u - gamma_3) / 2).
"""

import math
from dataclasses import replace
from typing import Any, Self

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim.models.law import Law, Packed
from hysim.models.model import Example, family
from hysim.models.parameters import Parameter, affine
from hysim.models.stages import Stage
from hysim.models.tables import Tables

_LARGEST = 709.0  # exponent beyond which the exponential function overflows
_MIRRORED = {"k_b": 1, "f_0": 1, "alpha": 1, "beta_1": -1, "beta_2": -1, "gamma_1": 1, "gamma_2": 1, "gamma_3": -1}
"""Signs of the numbers of a falling input in a point-symmetric law, in the order of the step."""


@family
class VaianaRosati(Law):
    """Vaiana-Rosati law of structural devices: the force is drawn to one curve as u rises, to another one as it falls.

    ::

        df = dc + alpha (c - f) |du|,    c = c_+ where u rises, c_- where u falls
        c_s(u) = k_b u + s f_0 + beta_1 (exp(beta_2 u) - 1) + 2 gamma_1 tanh(gamma_2 (u - gamma_3) / 2),    s = 1, -1

    Eight numbers for each direction make loops that are asymmetric, pinched, S-shaped or flag-shaped; every stroke is
    evaluated exactly. Each parameter holds one number or two: two are those of a rising and of a falling input, as
    published. One number makes the law point symmetric: a falling input has the same, with the opposite sign for
    beta_1, beta_2 and gamma_3.

    Parameters
    ----------
    k_b : float or sequence of float
        Slope of the straight part of the curve [unit of y / unit of u].
    f_0 : float or sequence of float
        Height of the curve of a rising input at u = 0 above the other terms, and depth of that of a falling input
        [unit of y].
    alpha : float or sequence of float
        Rate at which the force is drawn to the curve, positive [1 / unit of u].
    beta_1, beta_2 : float or sequence of float
        Size [unit of y] and rate [1 / unit of u] of the exponential: stiffening or softening to one side.
    gamma_1, gamma_2, gamma_3 : float or sequence of float
        Half the height [unit of y], steepness [1 / unit of u] and place [unit of u] of the step of the curve.
    z0 : float
        Force at the first sample [unit of y].

    Raises
    ------
    ValueError
        If a number is not finite, alpha is not positive, or a parameter does not hold one number or two.

    Notes
    -----
    *Energy.* With ``h = (c_+ - c_-) / 2`` and one alpha for both, the steady cycle from a to b dissipates
    ``2 (integral of h - (h(a) + h(b)) tanh(alpha (b - a) / 2) / alpha)``. It is not negative in every steady cycle
    exactly if h'' <= alpha^2 h everywhere, such as where f_0 > 0 and both directions have the same other terms: then
    every path dissipates, by ``(f - k)^2 / f_0`` for each unit of path, k the mean of both curves. Curves that come
    close in the middle, or cross, may make a small cycle deliver energy: check pinched laws.

    *Inverse.* The slope df/du is c_s' + alpha s (c_s - f). Where it changes its sign the output turns, and
    `inverse_response` raises a SimulationError that names the sample.

    *Identification.* The output is affine in k_b, f_0, beta_1, gamma_1 and z0. `identify` searches two parallel lines
    (alpha alone), then the exponential, then the tanh with it, and keeps of them what lowers the BIC; for the tanh
    alone, fix beta_1 at zero. It searches as many numbers as the start has, and sixteen with
    ``hs.identify(hs.VaianaRosati().two_sided(), record)``.

    An exponent beta_2 u above 709 counts as diverged. The algebraic models of the same authors, whose branches end on
    the limiting curves, are other laws. Sources: N. Vaiana and L. Rosati, Mech. Syst. Signal Process. 182 (2023)
    109539; and 199 (2023) 110448, for the form without history variable.

    Examples
    --------
    >>> import hysim as hs
    >>> bearing = hs.VaianaRosati(k_b=0.5, f_0=1.0, alpha=10.0)
    >>> bearing.response([0.0, 1.0, 0.9, 0.0]).round(6).tolist()
    [0.0, 1.499955, 0.185742, -0.999909]
    """

    k_b: tuple[float, ...] = (1.0,)
    f_0: tuple[float, ...] = (1.0,)
    alpha: tuple[float, ...] = (1.0,)
    beta_1: tuple[float, ...] = (0.0,)
    beta_2: tuple[float, ...] = (0.0,)
    gamma_1: tuple[float, ...] = (0.0,)
    gamma_2: tuple[float, ...] = (1.0,)
    gamma_3: tuple[float, ...] = (0.0,)
    z0: float = 0.0

    positive = ("alpha",)
    example = Example(
        {
            "k_b": 0.1, "f_0": 0.5, "alpha": 4.0, "beta_1": 0.1, "beta_2": 1.0,
            "gamma_1": 0.5, "gamma_2": 4.0, "gamma_3": 0.15,
        },
        (-2.0, 2.0),
        title="Vaiana-Rosati: pinched joint",
        group="Devices",
    )  # fmt: skip
    searched = (
        *affine("k_b", unit="y/u"),
        *affine("f_0", "beta_1", "gamma_1", "z0", unit="y"),
        Parameter("alpha", 1e-1, 1e3, unit="1/u", log=True),
        Parameter("beta_2", -20.0, 20.0, unit="1/u"),
        Parameter("gamma_2", 1e-1, 1e3, unit="1/u", log=True),
        Parameter("gamma_3", -1.0, 1.0, unit="u", from_first=True),
    )

    @staticmethod
    def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
        """Output at the next input `u`; `state` moves along."""
        if u != state[0] and math.isfinite(state[1]):  # a force that has diverged remains so
            last, rise = state[0], u - state[0]
            k = 0 if rise > 0.0 else 8
            beta_1, beta_2, gamma_1, half = parameters[k + 3], parameters[k + 4], parameters[k + 5], parameters[k + 6]
            gained = parameters[k] * rise
            above = state[1] - parameters[k] * last - parameters[k + 1]
            if beta_1 != 0.0:
                top = max(beta_2 * last, beta_2 * u)
                grown = beta_1 * math.exp(top) if top < _LARGEST else math.inf
                gained -= math.copysign(1.0, beta_2 * rise) * grown * math.expm1(-abs(beta_2 * rise))
                above -= beta_1 * math.expm1(min(beta_2 * last, _LARGEST))
            if gamma_1 != 0.0:
                before, after = math.tanh(half * (last - parameters[k + 7])), math.tanh(half * (u - parameters[k + 7]))
                gained += 2.0 * gamma_1 * math.tanh(half * rise) * (1.0 - before * after)
                above -= 2.0 * gamma_1 * before
            f = state[1] + gained + above * math.expm1(-parameters[k + 2] * abs(rise))
            state[1] = f if math.isfinite(f) else math.inf
        state[0] = u
        return float(state[1])

    @classmethod
    def check(cls, tables: Tables) -> None:
        for name in _MIRRORED:
            if tables[name].shape[1] not in (1, 2):
                raise ValueError(f"{name} must hold one number or two, got {tables[name].shape[1]}")
        super().check(tables)

    @classmethod
    def pack(cls, tables: Tables) -> Packed:
        """For each direction k_b, the height s f_0, ..., gamma_2 / 2 and gamma_3, and the memory (u, f)."""
        pairs = {
            name: np.concatenate([table[:, :1], table[:, -1:] * (sign if table.shape[1] == 1 else 1)], axis=1)
            for name, sign in _MIRRORED.items()
            for table in [tables[name]]
        }
        pairs |= {"f_0": pairs["f_0"] * np.array([1.0, -1.0]), "gamma_2": 0.5 * pairs["gamma_2"]}
        columns = [pair[:, [k]] for k in (0, 1) for pair in pairs.values()]
        return Packed(np.concatenate(columns, axis=1), cls.initial_memory(tables))

    def freed_in_turn(self) -> tuple[Stage, ...]:
        stages = []
        for word, letter in (("exponential", "beta"), ("tanh", "gamma")):
            names = tuple(name for name in self.scalars if name.startswith(letter))
            stages.append(Stage(word, names, {name: 0.0 for name in names if name.startswith(f"{letter}_1")}))
        return tuple(stages)

    def two_sided(self) -> Self:
        """The same law with two numbers in every parameter: a start for `hysim.identify` that may be asymmetric."""
        own = self.arguments
        pairs: dict[str, Any] = {name: (*own[name], sign * own[name][0])[:2] for name, sign in _MIRRORED.items()}
        return replace(self, **pairs)

    @classmethod
    def from_coleman_hodgdon(
        cls, *, alpha: float, c: float, B: float, offset: float = 0.0, z0: float = 0.0, u0: float = 0.0
    ) -> Self:
        """The law with the outputs of a `ColemanHodgdon` from the first input `u0` on.

        Its limiting curves are two lines of the slope c, (B - c) / alpha above and below the offset.

        Examples
        --------
        >>> import hysim as hs
        >>> numbers = {"alpha": 2.0, "c": 0.5, "B": 1.5, "offset": 0.1}
        >>> law = hs.VaianaRosati.from_coleman_hodgdon(**numbers)
        >>> law.response([0.0, 1.0]).tolist() == hs.ColemanHodgdon(**numbers).response([0.0, 1.0]).tolist()
        True
        """
        height = (B - c) / alpha
        return cls(k_b=(c,), f_0=(height + offset, height - offset), alpha=(alpha,), z0=offset + c * u0 + z0)
