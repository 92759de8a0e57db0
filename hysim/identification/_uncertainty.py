"""Standard errors by the linearised model, and what the data cannot tell.

At the optimum the residual is linear in all free parameters p = (searched, linear). With J = dy/dx in the
search's coordinates and the columns of the linear parameters, and G the Jacobian of the way back to the
user's parameters, the covariance is

    cov = s^2 G (J^T J)^-1 G^T,   s^2 = ||residual||^2 / (N - d).

A coordinate at a side of its box is taken as known; it and a direction along which the output does not
change have no standard error.
"""

import numpy as np

from hysim._frozen import FloatArray
from hysim.identification._projection import Projection

_SINGULAR = 1e-7  # below this share of the largest, a direction of the scaled Jacobian is not identifiable
_AT_SIDE = 1e-6  # in units of the box


def covariance(problem: Projection, x: FloatArray, residual: FloatArray) -> tuple[FloatArray, list[str]]:
    """Covariance in the order of `space.names`, nan where it is unknown, and the reasons in words."""
    space = problem.space
    freedom = residual.size - len(space.names)
    unknown = np.full((len(space.names), len(space.names)), np.nan)
    if freedom <= 0:
        return unknown, [f"no standard errors: {residual.size} samples for {len(space.names)} parameters"]
    jacobian, way_back = _jacobians(problem, x)
    if not np.isfinite(jacobian).all():
        return unknown, ["no standard errors: the output is not finite beside the optimum"]
    margin = _AT_SIDE * (space.upper - space.lower)
    at_side = (x - space.lower < margin) | (space.upper - x < margin)
    reasons = [f"{name} is at a side of its box" for name, side in zip(space.coordinates, at_side, strict=True) if side]
    known = np.concatenate([at_side, np.zeros(len(space.linear), dtype=bool)])
    jacobian[:, known], way_back[:, known] = 0.0, 0.0
    norms = np.linalg.norm(jacobian, axis=0)
    norms[norms == 0.0] = 1.0
    _, singular, right = np.linalg.svd(jacobian / norms, full_matrices=False)
    told = singular > _SINGULAR * singular[0]
    directions = way_back / norms @ right.T
    spread = directions[:, told] / singular[told]
    result = float(residual @ residual) / freedom * spread @ spread.T
    blind = np.abs(directions[:, ~told]).max(axis=1, initial=0.0)
    size = np.abs(directions).max(axis=1)
    lost = blind > 1e-3 * size
    if lost.any():
        reasons.append(f"the data cannot tell {', '.join(np.array(space.names)[lost])} apart")
    nowhere = lost | (size == 0.0)
    result[nowhere], result[:, nowhere] = np.nan, np.nan
    return result, reasons


def _jacobians(problem: Projection, x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """dy/d(searched, linear), and d(user's names)/d(searched, linear)."""
    space = problem.space
    linear = problem.solve(x[np.newaxis])[0][0]
    ahead, behind, steps = (values[0] for values in problem.neighbours(x[np.newaxis]))
    points = np.concatenate([ahead, behind, x[np.newaxis]])
    parameters = space.parameters(points)
    columns, fixed_part = problem.split(parameters)
    outputs = columns @ linear + fixed_part
    n_x, n_names = x.size, len(space.names)
    way_back = np.zeros((n_names, n_x + len(space.linear)))
    for row, name in enumerate(space.names):
        if name in space.linear:
            way_back[row, n_x + space.linear.index(name)] = 1.0
        else:
            values = parameters[name]
            way_back[row, :n_x] = (values[:n_x] - values[n_x : 2 * n_x]) / steps
    return np.column_stack([(outputs[:n_x] - outputs[n_x : 2 * n_x]).T / steps, columns[-1]]), way_back
