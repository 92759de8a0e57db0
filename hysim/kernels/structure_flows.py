"""Exact flow of a linear structure over a step, and over its dyadic parts.

    s' = A s + sum over loads of l p(t),    s = (x, v),    A = (0, 1; -K/M, -C/M),    l = (0; b/M)

A load is a cubic of the step's own time, p = c0 + c1 s + c2 s^2 + c3 s^3 with s from 0 to 1. The flow over a step h is

    s(h) = E s(0) + sum over loads of (P0 c0 + ... + P3 c3),    Pj = integral over (0, h) of exp(A (h - t)) l (t/h)^j

At the smallest step both are Taylor series; from a step h to 2 h they follow without another series:

    E <- E E,   Pj <- (E Pj + sum over i of binomial(j, i) Pi) / 2^j

All matrices are stored by their columns: a vector is multiplied by adding up columns, in one order of the sums.
"""

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import inner, uncounted, unfolded

_SERIES = 0.25  # largest phase of the stiffest mode in the step of the series
N_POWERS = 4  # of a load's time
_TERMS = 14  # of the series: the next one is below the rounding at this phase
_MOST_HALVES = 60
_SHORT = 8  # vectors that are added up one number after the other: a loop over columns does not pay


@inner
def fill_flows(
    A: FloatArray, loads: FloatArray, rate: float, h: float, E: FloatArray, P: FloatArray, spare: FloatArray,
    past: FloatArray,
) -> None:  # fmt: skip
    """Flows over the steps h, h/2, h/4, ... into `E`, (n_levels, m, m), and `P`, (n_levels, n_loads, 4, m).

    `A` is (m, m), row by row; `loads` is (n_loads, m); `rate` is that of the fastest mode [1/s]. ``E[k][i]`` is the
    column of state i. `spare`, (2, m, m), and `past`, (2, n_loads, 4, m), are room for work.
    """
    halves, last = E.shape[0] - 1, E.shape[0] - 1
    while rate * h / 2.0**halves > _SERIES and halves < _MOST_HALVES:
        halves += 1
    series(A, loads, h / 2.0**halves, spare[0], past[0], spare[1])
    for level in range(halves, -1, -1):
        if level <= last:
            copy_flow(spare[0], past[0], E[level], P[level])
        if level > 0:
            double(spare[0], past[0], spare[1], past[1])


@uncounted
def put(values: FloatArray, out: FloatArray) -> None:
    """Copy a vector."""
    for q in range(values.size):
        out[q] = values[q]


@uncounted
def copy_flow(E: FloatArray, P: FloatArray, E_out: FloatArray, P_out: FloatArray) -> None:
    """Copy a flow."""
    for i in range(E.shape[0]):
        put(E[i], E_out[i])
    for i in range(P.shape[0]):
        for j in range(N_POWERS):
            put(P[i, j], P_out[i, j])


@uncounted
def series(A: FloatArray, loads: FloatArray, h: float, E: FloatArray, P: FloatArray, room: FloatArray) -> None:
    """The Taylor series of a short step; two rows of `room` are overwritten."""
    m = A.shape[0]
    for i in range(m + loads.shape[0]):
        term, following = room[0], room[1]
        for q in range(m):
            term[q] = (1.0 if q == i else 0.0) if i < m else loads[i - m, q]
        if i < m:
            for q in range(m):
                E[i, q] = term[q]
        else:
            for j in range(N_POWERS):
                for q in range(m):
                    P[i - m, j, q] = 0.0
        for k in range(1, _TERMS + 1):  # the term of a load is A^(k-1) l h^(k-1) / (k-1)!
            if i >= m:
                for j in range(N_POWERS):
                    weight = h / k  # h^k j! / (k + j)! in front of A^(k-1) l
                    for q in range(1, j + 1):
                        weight *= q / (k + q)
                    for q in range(m):
                        P[i - m, j, q] += weight * term[q]
            for q in range(m):
                total = 0.0
                for p in range(m):
                    total += A[q, p] * term[p]
                following[q] = h / k * total
            for q in range(m):
                term[q] = following[q]
                if i < m:
                    E[i, q] += term[q]


@uncounted
def double(E: FloatArray, P: FloatArray, square_of: FloatArray, past: FloatArray) -> None:
    """The flow over twice the step in place of that over the step."""
    m = E.shape[0]
    for i in range(P.shape[0]):
        for j in range(N_POWERS):
            apply(E, P[i, j], past[i, j])
    for i in range(P.shape[0]):
        for q in range(m):
            constant, linear, square, cube = P[i, 0, q], P[i, 1, q], P[i, 2, q], P[i, 3, q]
            P[i, 0, q] = past[i, 0, q] + constant
            P[i, 1, q] = 0.5 * (past[i, 1, q] + constant + linear)
            P[i, 2, q] = 0.25 * (past[i, 2, q] + constant + 2.0 * linear + square)
            P[i, 3, q] = 0.125 * (past[i, 3, q] + constant + 3.0 * (linear + square) + cube)
    for i in range(m):
        apply(E, E[i], square_of[i])
    for i in range(m):
        put(square_of[i], E[i])


@uncounted
def apply(E: FloatArray, x: FloatArray, out: FloatArray) -> None:
    """The columns `E`, (n, m), with the weights `x`, (n,), added up in `out`, (m,)."""
    for q in range(out.size):
        out[q] = 0.0
    add_long_columns(E, x, out)


@unfolded
def add_columns(columns: FloatArray, weights: FloatArray, out: FloatArray) -> None:
    """Add columns (k, m) with weights (k,) to `out`, (m,); the order of the sums is that of the columns."""
    if out.size > _SHORT:
        add_long_columns(columns, weights, out)
        return
    for q in range(out.size):
        total = out[q]
        for i in range(weights.size):
            total += weights[i] * columns[i, q]
        out[q] = total


@uncounted
def add_long_columns(columns: FloatArray, weights: FloatArray, out: FloatArray) -> None:
    """As `add_columns`, a column after the other."""
    for i in range(weights.size):
        weight = weights[i]
        for q in range(out.size):
            out[q] += weight * columns[i, q]
