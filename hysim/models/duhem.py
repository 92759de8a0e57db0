"""The polynomial Duhem law: one slope where the input rises, another where it falls.

    y' = u' p(u, y) + |u'| q(u, y),    p = sum p_ij u^i y^j,    q = sum q_ij u^i y^j
    dy/du = p + q  where u rises,      dy/du = p - q  where u falls

u is the input, y the output; there is no other memory than y itself. The law does not depend on time.
It has hysteresis exactly if q is not zero. The output is evaluated at the samples of an input that is
linear between them by power series (`hysim.kernels.duhem`), to 1e-12 of the range. Special cases:

    Coleman-Hodgdon    p = b,  q = a (c u - y)        Dahl    p = r,  q = -(r / F) y

Sources: P. Duhem 1897; B. D. Coleman and M. L. Hodgdon, Int. J. Eng. Sci. 24 (1986).
"""

from collections.abc import Mapping
from typing import Self

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, read_only
from hysim._parallel import in_chunks
from hysim.errors import SimulationError
from hysim.kernels import duhem as kernels
from hysim.models import _duhem_search
from hysim.models.duhem_terms import Term, branches, equation, polynomials
from hysim.models.model import CompiledLaw, model
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.records import Record

State = tuple[float, float]
"""Last input and output."""

_BOUND = 1e3


@model
class Duhem:
    """Polynomial Duhem law, ``y' = u' p(u, y) + |u'| q(u, y)``.

    Parameters
    ----------
    p, q : array, shape (rows, columns)
        Element [i, j] multiplies ``u^i y^j`` [unit of y^(1-j) / unit of u^(i+1)]. The shapes may differ.
    y0 : float
        Output at the first sample [unit of y].

    Raises
    ------
    ValueError
        If an array is empty, has not two axes, or a number is not finite.

    Examples
    --------
    >>> import hysim as hs
    >>> law = hs.Duhem.from_terms({"u'": 1.0, "|u'| y": -1.0})  # Dahl's
    >>> law.equation
    "y' = u' (1) + |u'| (-1 y)"
    >>> law.response([0.0, 1.0, -1.0]).round(6).tolist()
    [0.0, 0.632121, -0.779117]
    """

    p: FloatArray
    q: FloatArray
    y0: float = 0.0

    def __post_init__(self) -> None:
        for name in ("p", "q"):
            shape = getattr(self, name).shape
            if len(shape) != 2 or 0 in shape:
                raise ValueError(f"{name} must have two axes and at least one element, got shape {shape}")

    @classmethod
    def from_terms(cls, terms: Mapping[str, float], *, y0: float = 0.0) -> Self:
        """The law with these coefficients.

        Parameters
        ----------
        terms : mapping
            Names such as ``"u'"``, ``"u' u^2"``, ``"|u'| u y"`` to coefficients.
        y0 : float
            Output at the first sample.

        Raises
        ------
        ValueError
            If a name is not in the vocabulary.
        """
        parsed = [Term.parse(name) for name in terms]
        p, q = polynomials(parsed, np.array([list(terms.values())], dtype=float))
        return cls(p=p[0], q=q[0], y0=y0)

    @property
    def terms(self) -> dict[str, float]:
        """Coefficients that are not zero by term, all of ``u'`` before those of ``|u'|``, each by degree."""
        found = {
            Term(rectified, int(i + j), int(j)): float(part[i, j])
            for rectified, part in ((False, self.p), (True, self.q))
            for i, j in np.argwhere(part)
        }
        return {term.name: found[term] for term in sorted(found)}

    @property
    def equation(self) -> str:
        """The law as text, coefficients to 4 significant digits."""
        return equation(self.terms)

    def response(self, u: npt.ArrayLike) -> FloatArray:
        """Output y at the samples of an input that is linear between them.

        Parameters
        ----------
        u : array, shape (n_samples,)
            Input; the first sample finds the output at y0.

        Returns
        -------
        array, shape (n_samples,)

        Raises
        ------
        SimulationError
            If the output escapes to infinity; it names the sample.
        ValueError
            If u is not finite or has not one axis.
        """
        return self.advance(u)[0]

    def memory(self, u: npt.ArrayLike) -> FloatArray:
        """The memory, which is the output: see `response`."""
        return self.response(u)

    def advance(self, u: npt.ArrayLike, state: State | None = None) -> tuple[FloatArray, State]:
        """Output at the samples of `u`, continued from `state`, and the state after the last sample.

        Parameters
        ----------
        u : array, shape (n_samples,)
            Input, linear between its samples and from the state's input to the first of them.
        state : (float, float), optional
            Input and output at the last sample so far; by default ``(u[0], y0)``.

        Returns
        -------
        y : array, shape (n_samples,)
            The same bits as from one uncut input.
        state : (float, float)
            To continue from.

        Raises
        ------
        SimulationError, ValueError
            As `response`.
        """
        inputs = read_only(u, "u", ndim=1)
        if state is None:
            state = (float(inputs[0]) if inputs.size else 0.0), self.y0
        y = np.empty(inputs.size)
        rising, falling = branches(self.p, self.q)
        with np.errstate(all="ignore"):  # an escape overflows, and uncompiled kernels would warn of it
            lost = kernels.path(rising, falling, float(state[0]), float(state[1]), inputs, kernels.LARGEST, y)
        if lost >= 0:
            what = "is too stiff to be followed" if np.isnan(y[lost]) else "escapes to infinity"
            raise SimulationError(f"the output {what} at sample {lost} (u = {inputs[lost]:g}): {self.equation}")
        return y, (float(inputs[-1]), float(y[-1])) if y.size else state

    def compiled(self, u0: float = 0.0) -> CompiledLaw:
        """The law as compiled loops take it; the state is that of a first sample at the input `u0`."""
        rising, falling = branches(self.p, self.q)
        parameters = np.concatenate([rising.shape, rising.ravel(), falling.ravel()])
        state = np.zeros(kernels.state_size(*rising.shape))
        state[:2] = u0, self.y0
        return CompiledLaw(kernels.step, read_only(parameters), state)

    @classmethod
    def responses(cls, parameters: Parameters, u: npt.ArrayLike, *, workers: int | None = None) -> FloatArray:
        """Outputs of many laws at once, on all cores.

        Parameters
        ----------
        parameters : mapping
            ``"p"`` and ``"q"``, shape (n_sets, rows, columns) or (rows, columns) for all sets, and
            optionally ``"y0"``, shape (n_sets,) or one number.
        u : array, shape (n_samples,) or (n_sets, n_samples)
            One input for all sets, or one for each.
        workers : int, optional
            Number of threads; by default one for each core. The result does not depend on it.

        Returns
        -------
        array, shape (n_sets, n_samples)
            Each row the same bits as `response`. A law that escapes is a row of inf.

        Raises
        ------
        TypeError
            If a name is not one of the constructor's, or p or q is missing.
        ValueError
            If lengths do not fit, or a value is not finite.
        """
        return cls._outputs(parameters, u, kernels.LARGEST, workers)

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """The box that `identify` searches; see `hysim.models._duhem_search`."""
        return _duhem_search.search_space({**self.terms, "y0": self.y0}, record, freedom)

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        """The output itself, shape (n_sets, n_samples, 1): it is affine in none of the parameters.

        A law that goes 1000 times as far as the record counts as one that escapes: following it costs much
        and can only lose.
        """
        values = {**self.terms, "y0": self.y0, **parameters}
        names = list(values)
        sets = np.stack(np.broadcast_arrays(*map(np.atleast_1d, values.values())), axis=1)
        is_term = np.array([name != "y0" for name in names])
        p, q = polynomials([Term.parse(name) for name in names if name != "y0"], sets[:, is_term])
        bound = _BOUND * (float(np.abs(record.y).max()) or 1.0)
        return self._outputs({"p": p, "q": q, "y0": sets[:, ~is_term][:, 0]}, record.u, bound, None)[..., np.newaxis]

    def assemble(self, parameters: Mapping[str, float]) -> Self:
        """The law with these parameters, one number for each name."""
        return self.from_terms(
            {name: value for name, value in parameters.items() if name != "y0"}, y0=parameters.get("y0", self.y0)
        )

    @classmethod
    def _outputs(cls, parameters: Parameters, u: npt.ArrayLike, bound: float, workers: int | None) -> FloatArray:
        if not {"p", "q"} <= set(parameters) <= {"p", "q", "y0"}:
            raise TypeError(f"the parameters of Duhem are p, q and y0, got {', '.join(parameters)}")
        axes = {"p": 3, "q": 3, "y0": 1, "u": 2}
        given = {
            name: read_only(_with_axes(values, axes[name]), name, ndim=axes[name])
            for name, values in {"y0": 0.0, **parameters, "u": u}.items()
        }
        lengths = {name: len(values) for name, values in given.items() if len(values) != 1}
        if len(set(lengths.values())) > 1:
            raise ValueError(f"parameters and inputs must have one length or length 1, got {lengths}")
        n_sets = next(iter(lengths.values()), 1)
        rising, falling = (
            read_only(np.broadcast_to(part, (n_sets, *part.shape[1:]))) for part in branches(given["p"], given["q"])
        )
        y0 = read_only(np.broadcast_to(given["y0"], n_sets))
        y = np.empty((n_sets, given["u"].shape[1]))

        def work(start: int, stop: int) -> None:
            with np.errstate(all="ignore"):
                kernels.batch(rising, falling, y0, given["u"], bound, y, start, stop)

        in_chunks(work, n_sets, workers=workers)
        return y


def _with_axes(values: npt.ArrayLike, ndim: int) -> npt.NDArray[np.generic]:
    """`values` with leading axes of length 1 up to `ndim`."""
    array = np.asarray(values)
    return array.reshape((1,) * (ndim - array.ndim) + array.shape)
