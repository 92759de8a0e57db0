"""Free runs of many polynomial Duhem laws at once.

Each law runs (`hysim.kernels.duhem`) on its own memory from its first output, y = feedthrough u + z, not a record's.
"""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, read_only
from hysim._basics.parallel import in_chunks
from hysim.kernels import duhem as kernels
from hysim.kernels.branch import MAX_STEPS
from hysim.laws.differential.terms import Polynomials, Term, polynomials

SAMPLES_A_THREAD = 20_000


def free_runs(
    terms: Sequence[Term],
    coefficients: FloatArray,
    feedthrough: npt.ArrayLike,
    y0: npt.ArrayLike,
    u: FloatArray,
    bound: float,
    *,
    most_steps: int = MAX_STEPS,
    workers: int | None = None,
) -> tuple[FloatArray, int]:
    """Outputs (n_sets, n_samples) of many laws, inf where one diverges, and the slopes that they take.

    The `coefficients` are (n_sets, n_terms), `feedthrough` and `y0` one number or (n_sets,), the inputs `u` (1 or
    n_sets, n_samples) and read-only. A law whose memory goes beyond the `bound`, or that needs more than `most_steps`
    steps between two samples, counts as diverging. The result does not depend on the number of `workers`.
    """
    laws = branches(polynomials(terms, np.atleast_2d(coefficients)))
    direct, first = np.atleast_1d(feedthrough), np.atleast_1d(y0)
    n_sets = max(len(laws), direct.size, first.size, len(u))
    parameters = read_only(np.broadcast_to(packed(laws), (n_sets, kernels.N_HEAD + laws[0].size)), finite=False)
    z0 = np.broadcast_to(first - direct * (u[:, 0] if u.size else 0.0), n_sets)
    z0 = read_only(z0, finite=False)
    y, taken = np.empty((n_sets, u.shape[1])), list[int]()

    def work(start: int, stop: int) -> None:
        k = slice(start, stop)
        inputs = u if len(u) == 1 else u[k]
        with np.errstate(all="ignore"):  # a memory that diverges overflows, and uncompiled kernels would warn of it
            taken.append(kernels.batch(parameters[k], z0[k], inputs, bound, most_steps, y[k]))

    in_chunks(work, n_sets, workers=workers, minimum=1 + SAMPLES_A_THREAD // max(1, u.shape[1]))
    if direct.any():
        y += direct[:, np.newaxis] * u
    return y, sum(taken)


def packed(laws: FloatArray, offset: FloatArray | float = 0.0, feedthrough: FloatArray | float = 0.0) -> FloatArray:
    """Parameters (n_sets, n_parameters) of the step of laws of `branches`."""
    head = [*np.broadcast_arrays(offset, feedthrough, np.zeros((len(laws), 1)))[:2]]
    shape = np.broadcast_to(np.array(laws.shape[1:], dtype=float), (len(laws), 3))
    return np.concatenate([*head, shape, laws.reshape(len(laws), -1)], axis=1)


def branches(parts: Polynomials) -> FloatArray:
    """The polynomials of dz/du as kernels take them, read-only.

    They are p + q where u rises and p - q where it falls, shape (..., 2, rows, columns), or (..., 4, rows, columns)
    with each for z >= 0 and for z <= 0, if any of the laws has a term with |z|.
    """
    two_sided = bool(parts.p_abs.any() or parts.q_abs.any())
    barred = (parts.p_abs, parts.q_abs) if two_sided else ()
    shapes = [(part.shape[-2], part.shape[-1]) for part in (parts.p, parts.q)]
    shapes += [(part.shape[-2], part.shape[-1] + 1) for part in barred]
    rows, columns = (max(lengths) for lengths in zip(*shapes, strict=True))
    p, q = (_padded(part, rows, columns) for part in (parts.p, parts.q))
    smooth = np.stack([p + q, p - q], axis=-3)
    if two_sided:
        p, q = (_padded(part, rows, columns, shift=1) for part in barred)
        bent = np.stack([p + q, p - q], axis=-3)
        sides = np.stack([smooth + bent, smooth - bent], axis=-3)
        smooth = sides.reshape(*sides.shape[:-4], 4, rows, columns)
    smooth.setflags(write=False)  # kernels are compiled anew for arrays that can be written
    return smooth


def _padded(part: FloatArray, rows: int, columns: int, *, shift: int = 0) -> FloatArray:
    """`part` in an array of zeros of this size, `shift` powers of z higher."""
    larger = np.zeros_like(part, shape=(*part.shape[:-2], rows, columns))
    larger[..., : part.shape[-2], shift : shift + part.shape[-1]] = part
    return larger
