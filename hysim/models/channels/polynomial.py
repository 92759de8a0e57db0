"""A parameter as a polynomial of a channel, known by its values at some places of the channel.

    p(T) = sum_k p_k l_k(T),    l_k(T) = prod_(j != k) (T - T_j) / (T_k - T_j)

The values p_k are parameters of the same kind as p, in the same unit and the same box, and are well determined together
where coefficients of powers are not: those of 1 and T at 20 to 60 degC are correlated by 0.96. Of degree 1 the places
are the ends of the identified range; of higher degrees those of Chebyshev and Lobatto, which keep a polynomial near its
values.
"""

import numpy as np
import numpy.typing as npt

from hysim._channels import label
from hysim._frozen import FloatArray
from hysim.models.model import family

_OUTSIDE = 1e-9  # of the identified range: rounding


@family
class ChannelPolynomial:
    """A parameter that is a polynomial of a channel, by its values at places of the channel.

    Parameters
    ----------
    parameter : str
        Name of a number of the law, as in `Law.scalars`.
    channel : str
        Name of the channel.
    at : tuple of float
        Increasing places [unit of the channel]; one place for a parameter that is constant.
    values : tuple of float
        Values of the parameter there [unit of the parameter].
    span : tuple of (float, float), optional
        Range of the channel in which the polynomial is known; by default from the first place to the last one.

    Raises
    ------
    ValueError
        If the places do not increase, or there are not as many values.

    Examples
    --------
    >>> import hysim as hs
    >>> gain = hs.ChannelPolynomial(parameter="gain", channel="T", at=(20.0, 60.0), values=(2.0, 1.0))
    >>> float(gain.value(30.0)), gain.coefficients
    (1.75, (2.5, -0.025))
    """

    parameter: str
    channel: str
    at: tuple[float, ...]
    values: tuple[float, ...]
    span: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not self.at or (np.diff(self.at) <= 0.0).any():
            raise ValueError(f"at must hold increasing places of {self.channel!r}, got {self.at}")
        if len(self.values) != len(self.at):
            raise ValueError(f"values must hold one number for each of the {len(self.at)} places, got {self.values}")
        span = self.span or (self.at[0], self.at[-1])
        if len(span) != 2 or not span[0] <= span[1]:
            raise ValueError(f"span must be the lowest and the highest {self.channel!r}, got {span}")
        object.__setattr__(self, "span", span)

    @property
    def degree(self) -> int:
        """Degree of the polynomial."""
        return len(self.at) - 1

    @property
    def coefficients(self) -> tuple[float, ...]:
        """Coefficients of the powers 0, 1, ... of the channel."""
        rows = (self.values[k] * power_coefficients(self.at)[k] for k in range(len(self.at)))
        return tuple(np.sum(list(rows), axis=0).tolist())

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each value, such as ``"gain(T=20)"``; that of a constant is the parameter's own."""
        return names_of(self.parameter, self.channel, self.at)

    def value(self, channel: npt.ArrayLike) -> FloatArray:
        """Value of the parameter at values of the channel, of the same shape."""
        return np.asarray(weights(self.at, channel) @ np.array(self.values))

    def is_known_at(self, channel: npt.ArrayLike) -> bool:
        """Whether values of the channel lie in the identified range."""
        low, high = self.span
        slack = _OUTSIDE * (high - low)
        values = np.asarray(channel)
        return bool((values >= low - slack).all() and (values <= high + slack).all())


def names_of(parameter: str, channel: str, at: tuple[float, ...]) -> tuple[str, ...]:
    """Name of the value at each place."""
    return tuple(f"{parameter}({channel}={label(place, at)})" for place in at) if len(at) > 1 else (parameter,)


def places(low: float, high: float, degree: int) -> tuple[float, ...]:
    """Places of Chebyshev and Lobatto for a polynomial of this degree, the middle for degree 0."""
    if degree == 0:
        return (0.5 * (low + high),)
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    inner = (middle - half * np.cos(np.pi * np.arange(1, degree) / degree)).tolist()
    return (low, *inner, high)


def weights(at: tuple[float, ...], channel: npt.ArrayLike) -> FloatArray:
    """Weights of the values at the places, shape (..., n_places): exactly 0 and 1 at a place."""
    x, nodes = np.asarray(channel, dtype=float)[..., np.newaxis], np.array(at)
    products = []
    for k in range(nodes.size):
        others = np.delete(nodes, k)
        products.append(np.prod((x - others) / (nodes[k] - others), axis=-1))
    return np.stack(products, axis=-1)


def power_coefficients(at: tuple[float, ...]) -> FloatArray:
    """Coefficients of the powers 0, 1, ... of each weight, shape (n_places, n_places)."""
    nodes = np.array(at)
    rows = []
    for k in range(nodes.size):
        others = np.delete(nodes, k)
        powers = np.polynomial.polynomial.polyfromroots(others) / np.prod(nodes[k] - others)
        rows.append(powers)
    return np.array(rows)
