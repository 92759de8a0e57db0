"""The polynomial Duhem law along a piecewise-linear input.

    z' = u' p(u, z) + |u'| q(u, z),    p = sum (p_ij + p_abs_ij |z|) u^i z^j,    q likewise

On a stretch of the input in one direction time drops out, and on one side of z = 0 so does the bar of |z|. What is left
is one of two equations, or of four in a law with |z|,

    dz/du = f(u, z) = sum f_ij u^i z^j

that `hysim.kernels.branch` integrates. The parameters are (offset, feedthrough, 2 or 4, rows, columns, law), with the
law's polynomials f where u rises and where it falls; with |z|, each for z >= 0 and then for z <= 0.
"""

import math

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import kernel, uncounted
from hysim.kernels.branch import LARGEST, MAX_STEPS, TOLERANCE, follower, workspace

N_HEAD = 5
N_STATE = 2 + workspace(1)


@uncounted
def rates(parameters: FloatArray, x: FloatArray, u: float, s: float, side: float, out: FloatArray) -> None:
    """f(u, z), on this side of z = 0."""
    laws, rows, columns, z = int(parameters[2]), int(parameters[3]), int(parameters[4]), x[0]
    part = (0 if s > 0.0 else laws // 2) + (1 if laws == 4 and (side < 0.0 or (side == 0.0 and z < 0.0)) else 0)
    first = N_HEAD + part * rows * columns
    total = 0.0
    for i in range(rows - 1, -1, -1):
        row = 0.0
        for j in range(columns - 1, -1, -1):
            row = row * z + parameters[first + i * columns + j]
        total = total * u + row
    out[0] = total


@uncounted
def unlimited(parameters: FloatArray, x: FloatArray, slope: float, s: float) -> float:
    """A polynomial has nothing narrow."""
    return math.inf


follow = follower(rates, unlimited)


@kernel
def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """Output at the next input `u`; `state`, shape (N_STATE,), is (last u, z, work), and moves along."""
    follow(1, parameters, state, u, TOLERANCE, parameters[2] == 4.0, LARGEST, MAX_STEPS)
    return float(parameters[0] + (parameters[1] * u + state[1]))


@kernel
def start(parameters: FloatArray, state: FloatArray, u0: float) -> None:
    """Complete a state that holds the first output less the offset: the memory z is what the feedthrough leaves."""
    state[0] = u0
    state[1] -= parameters[1] * u0


@kernel
def batch(parameters: FloatArray, z0: FloatArray, u: FloatArray, bound: float, most: int, out: FloatArray) -> int:
    """Memories of many laws into `out`, (n_sets, n_samples); returns the slopes that they take.

    `parameters` is (n_sets, n_parameters), `z0` is (n_sets,), `u` is (1, n_samples) or (n_sets, n_samples). A law that
    goes beyond the `bound`, or needs more than `most` steps from one sample to the next, is a row of inf.
    """
    total, state = 0, np.zeros(N_STATE)
    for i in range(out.shape[0] if u.shape[1] > 0 else 0):
        row = u[min(i, u.shape[0] - 1)]
        state[0], state[1], state[-1] = row[0], z0[i], 0.0  # no slope is known yet
        for k in range(row.size):
            total += follow(1, parameters[i], state, row[k], TOLERANCE, parameters[i, 2] == 4.0, bound, most)
            out[i, k] = state[1]
            if not math.isfinite(state[1]):
                out[i] = math.inf
                break
    return total
