"""Exact flow of a linear structure over a step, and over its dyadic parts.

    s' = A s + sum over loads of l p(t),    s = (x, v),    A = (0, 1; -K/M, -C/M),    l = (0; b/M)

A load is a cubic of the step's own time, p = c0 + c1 s + c2 s^2 + c3 s^3 with s from 0 to 1. The flow over a step h is

    s(h) = E s(0) + sum over loads of (P0 c0 + ... + P3 c3),    Pj = integral over (0, h) of exp(A (h - t)) l (t/h)^j

At the smallest step both are Taylor series; from a step h to 2 h they follow without another series:

    E <- E E,   Pj <- (E Pj + sum over i of binomial(j, i) Pi) / 2^j

All matrices are stored by their columns: a vector is multiplied by adding up columns, in one order of the sums.
"""

import math

import numpy as np

from hysim._frozen import FloatArray
from hysim.kernels._compile import inner, kernel, unfolded

_SERIES = 0.25  # largest phase of the stiffest mode in the step of the series
N_POWERS = 4  # of a load's time
_TERMS = 14  # of the series: the next one is below the rounding at this phase
_MOST_HALVES = 60
_SHORT = 8  # vectors that are added up one number after the other: a loop over columns does not pay


@kernel
def fill_flows(A: FloatArray, loads: FloatArray, rate: float, h: float, E: FloatArray, P: FloatArray) -> None:
    """Flows over the steps h, h/2, h/4, ... into `E`, (n_levels, m, m), and `P`, (n_levels, n_loads, 4, m).

    `A` is (m, m), row by row; `loads` is (n_loads, m); `rate` is that of the fastest mode [1/s]. ``E[k][i]`` is the
    column of state i.
    """
    halves = E.shape[0] - 1
    while rate * h / 2.0**halves > _SERIES and halves < _MOST_HALVES:
        halves += 1
    now, column = np.empty_like(E[0]), np.empty(A.shape[0])
    past = np.empty_like(P[0])
    flow, responses = np.empty_like(E[0]), np.empty_like(P[0])
    series(A, loads, h / 2.0**halves, flow, responses)
    for level in range(halves, -1, -1):
        if level < E.shape[0]:
            E[level], P[level] = flow, responses
        if level > 0:
            double(flow, responses, now, past, column)


@inner
def series(A: FloatArray, loads: FloatArray, h: float, E: FloatArray, P: FloatArray) -> None:
    """The Taylor series of a short step."""
    m = A.shape[0]
    term, following = np.empty(m), np.empty(m)
    for i in range(m):
        term[:] = 0.0
        term[i] = 1.0
        E[i] = term
        for k in range(1, _TERMS + 1):
            propagate(A, term, h / k, following)
            term, following = following, term
            E[i] += term
    for i in range(loads.shape[0]):
        term[:] = loads[i]
        P[i] = 0.0
        for k in range(1, _TERMS + 1):  # the term is A^(k-1) l h^(k-1) / (k-1)!
            for j in range(N_POWERS):
                weight = h / k  # h^k j! / (k + j)! in front of A^(k-1) l
                for q in range(1, j + 1):
                    weight *= q / (k + q)
                for q in range(m):
                    P[i, j, q] += weight * term[q]
            propagate(A, term, h / k, following)
            term, following = following, term


@inner
def propagate(A: FloatArray, x: FloatArray, factor: float, out: FloatArray) -> None:
    """`factor` A x."""
    for i in range(x.size):
        total = 0.0
        for j in range(x.size):
            total += A[i, j] * x[j]
        out[i] = factor * total


@inner
def double(E: FloatArray, P: FloatArray, now: FloatArray, past: FloatArray, column: FloatArray) -> None:
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
        apply(E, E[i], column)
        now[i] = column
    E[:] = now


@inner
def apply(E: FloatArray, x: FloatArray, out: FloatArray) -> None:
    """The columns `E`, (n, m), with the weights `x`, (n,), added up in `out`, (m,)."""
    for q in range(out.size):
        out[q] = 0.0
    add_columns(E, x, out)


@unfolded
def add_columns(columns: FloatArray, weights: FloatArray, out: FloatArray) -> None:
    """Add columns (k, m) with weights (k,) to `out`, (m,); the order of the sums is that of the columns."""
    if out.size <= _SHORT:
        for q in range(out.size):
            total = out[q]
            for i in range(weights.size):
                total += weights[i] * columns[i, q]
            out[q] = total
    else:
        for i in range(weights.size):
            weight = weights[i]
            for q in range(out.size):
                out[q] += weight * columns[i, q]


def fastest(A: FloatArray) -> float:
    """Largest size of an eigenvalue of A [1/s]."""
    largest = float(np.abs(np.linalg.eigvals(A)).max()) if A.size else 0.0
    return largest if math.isfinite(largest) else math.inf
