"""Units in which a Bouc-Wen law is stepped by power series: powers of two, other than one for extreme laws only.

The series multiply powers such as w^n, w w^n, (dw/dL)^n and delta^n, which overflow or vanish where the memory or the
input is very large or very small and n is large, although the law is an ordinary one in other units. Where

    max(n, 3) |k| > 500    or    (n + 1) (|k| + 2 |m|) > 900

for a memory of order 2^k and an input of order 2^m, the step measures both in these units. With them

    A -> A 2^(m - k)    beta, gamma -> beta, gamma 2^(m + k (n - 1))    delta -> delta 2^(2 m - k)

an energy e goes over by 2^-(k + m), and q, which multiplies (1 / (beta + gamma))^(1/n), by 2^((m - k) / n). All other
laws keep their units, and so their bits.

The order of the memory is that of the balance (A / c)^(1/n) with c the larger of beta and gamma, and the order of the
input that of balance / A. Where A is zero or negligible, z0 or the forcing delta u gives both. A small z0 gives half
of its order if n < 1: a memory that grows then comes far away from there on any way.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray
from hysim.models.tables import Tables

_NEGLIGIBLE = 300.0  # in powers of two: a term that is smaller than another one by this factor gives no units
_LARGEST_POWER = 500.0  # of w^n; beyond it a memory counts as diverged (`hysim.kernels.baber_noori`)
_LARGEST_PRODUCT = 900.0  # of what the series multiply; numbers go up to 2^1023
_LARGEST_UNIT = 1000.0


class Units(NamedTuple):
    """Exponents of two of the units of the memory and of the input, each (n_sets, 1), of laws with the exponents n."""

    memory: FloatArray
    input: FloatArray
    n: FloatArray

    @property
    def scales(self) -> FloatArray:
        """Factors by which memory and input are multiplied, (n_sets, 2)."""
        return np.ldexp(1.0, -_integers(np.concatenate([self.memory, self.input], axis=1)))

    def shape(self, tables: Tables) -> FloatArray:
        """(A, beta, gamma, n) in these units, (n_sets, 4)."""
        A = self.times(tables["A"], self.input - self.memory)
        decay = [self._decay(tables[name]) for name in ("beta", "gamma")]
        return np.concatenate([A, *decay, self.n], axis=1)

    def times(self, values: FloatArray, exponent: FloatArray) -> FloatArray:
        """`values` times two to the `exponent`; exact where it is an integer."""
        return _times(values, np.rint(exponent), exponent - np.rint(exponent))

    def _decay(self, values: FloatArray) -> FloatArray:
        """beta or gamma. k n is split into an integer and a small rest, so that it is not rounded."""
        coarse = self.n.astype(np.float32).astype(float)  # few digits: its product with an integer is exact
        product = self.memory * coarse
        whole = np.rint(product)
        rest = (product - whole) + self.memory * (self.n - coarse)
        return _times(values, self.input - self.memory + whole, rest)


def units_with_ramp(tables: Tables) -> Units:
    """Units for the law of Zhu and Wang, whose forcing is A + delta u."""
    n, force, bend, start = _orders(tables)
    ramp = _order(tables["delta"])
    with np.errstate(invalid="ignore", divide="ignore"):
        memory, input_, started = _of_balance(n, force, bend, start)
        free = np.isneginf(bend)
        memory, input_ = np.where(free, 2.0 * force - ramp, memory), np.where(free, force - ramp, input_)
        power = 2.0 * n - 1.0  # delta u = c (delta u^2)^n
        ramped = ~started & ~free & ~(ramp + input_ <= force + _NEGLIGIBLE / n) & (np.abs(power) > 0.1)
        length = -(bend + (n - 1.0) * ramp) / power
        memory, input_ = np.where(ramped, ramp + 2.0 * length, memory), np.where(ramped, length, input_)
    return _units(n, memory, input_)


def units_with_wear(tables: Tables) -> Units:
    """Units for the law of Baber and Noori; without beta and gamma the wear gives them."""
    n, force, bend, start = _orders(tables)
    with np.errstate(invalid="ignore", divide="ignore"):
        memory, input_, _ = _of_balance(n, force, bend, start)
        energy = -np.maximum(_order(tables["delta_eta"]), _order(tables["delta_a"]) - force)
        free = np.isneginf(bend)
        memory = np.where(free, 0.5 * (energy + force), memory)
        input_ = np.where(free, 0.5 * (energy - force), input_)
    return _units(n, memory, input_)


def _orders(tables: Tables) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """n, and the orders of A, of beta and gamma, and of z0."""
    bend = np.maximum(_order(tables["beta"]), _order(tables["gamma"]))
    return tables["n"], _order(tables["A"]), bend, _order(tables["z0"])


def _of_balance(
    n: FloatArray, force: FloatArray, bend: FloatArray, start: FloatArray
) -> tuple[FloatArray, FloatArray, npt.NDArray[np.bool_]]:
    """Orders of memory and input where A and c w^n balance, or where A is negligible and z0 decays, and where it is."""
    memory = (force - bend) / n
    started = ~(start <= memory + _NEGLIGIBLE / n) & np.isfinite(start) & np.isfinite(bend)
    begun = np.where((n < 1.0) & (start < 0.0), 0.5 * start, start)
    input_ = np.where(started, begun - (bend + n * begun), memory - force)
    return np.where(started, begun, memory), input_, started


def _units(n: FloatArray, memory: FloatArray, input_: FloatArray) -> Units:
    """Units of these orders, one where they are ordinary or where there is no order."""
    known = np.isfinite(memory) & np.isfinite(input_)
    k, m = (np.clip(np.rint(np.where(known, order, 0.0)), -_LARGEST_UNIT, _LARGEST_UNIT) for order in (memory, input_))
    ordinary = np.maximum(n, 3.0) * np.abs(k) <= _LARGEST_POWER
    ordinary &= (n + 1.0) * (np.abs(k) + 2.0 * np.abs(m)) <= _LARGEST_PRODUCT
    return Units(np.where(ordinary, 0.0, k), np.where(ordinary, 0.0, m), n)


def _order(values: FloatArray) -> FloatArray:
    """Exponent of two of a number, the same bits in a batch and alone; minus infinity for zero."""
    return np.where(values == 0.0, -np.inf, np.frexp(values)[1])


def _times(values: FloatArray, whole: FloatArray, rest: FloatArray) -> FloatArray:
    """`values` times 2^(whole + rest), where neither factor overflows before the other."""
    with np.errstate(over="ignore", under="ignore"):
        return np.ldexp(values * np.exp2(rest), _integers(whole))


def _integers(exponents: FloatArray) -> npt.NDArray[np.int32]:
    """Exponents as `numpy.ldexp` takes them, cut to what no number survives."""
    return np.clip(exponents, -10_000.0, 10_000.0).astype(np.int32)
