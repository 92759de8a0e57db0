"""A law over its parameters, as a task with a batch form."""

import inspect
from collections.abc import Mapping
from typing import Any, Literal, Protocol, get_args, runtime_checkable

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, check_choice, checked, given_items, vectors
from hysim._results import model_of

Measure = Literal["rmse", "sse", "max_width", "area", "final", "response"]
_WITH_TARGET = ("rmse", "sse")


@runtime_checkable
class _ComputesMany(Protocol):
    def responses(self, *arguments: Any) -> FloatArray: ...


@checked
class ResponseTask:
    """A function from parameters of a law to one measure of its response, with a batch form; see `response_task`."""

    family: type
    fixed: Mapping[str, Any]
    u: FloatArray
    y: FloatArray | None
    measure: Measure

    def __call__(self, **parameters: float) -> dict[str, Any]:
        """The measure for one set of parameters, or the response, shape (n,), by its name."""
        return {name: values[0] for name, values in self.batch(**{k: [v] for k, v in parameters.items()}).items()}

    def batch(self, **parameters: npt.ArrayLike) -> dict[str, FloatArray]:
        """The measures for many sets, shape (n_sets,), or the responses, shape (n_sets, n), by their name."""
        laws: Any = self.family
        sets = {**self.fixed, **parameters}
        if self.measure == "response":
            return {"response": laws.responses(sets, self.u, workers=1)}
        reduce = "sse" if self.measure == "rmse" else self.measure
        values = laws.responses(sets, self.u, reduce=reduce, target=self.y, workers=1)
        return {self.measure: np.sqrt(values / self.u.size) if self.measure == "rmse" else values}


def response_task(
    law: Any, u: npt.ArrayLike, y: npt.ArrayLike | None = None, measure: Measure = "rmse"
) -> ResponseTask:
    """A task for `sweep`: how a law's response depends on its parameters.

    Parameters
    ----------
    law : law, result of a fit, or class
        A law, which gives the values of the parameters that the study does not vary; or its class, for its defaults.
    u : array, shape (n,)
        Input, linear between its samples.
    y : array, shape (n,), optional
        Output to compare the response with, for ``"rmse"`` and ``"sse"``.
    measure : {"rmse", "sse", "max_width", "area", "final", "response"}
        Root of the mean, or sum, of the squared differences from `y`; a measure of `loop_metrics`; the last sample; or
        the response itself as an array. It is inf for a law that diverges.

    Returns
    -------
    ResponseTask
        A function of the law's parameters, whose batch form computes many sets at once on one thread.

    Raises
    ------
    TypeError
        If the family has no ``responses``, or none with this measure.
    ValueError
        If the measure is unknown, `y` is missing or not needed, or the lengths differ.

    Examples
    --------
    >>> import hysim as hs
    >>> rec = hs.datasets.table1()
    >>> task = hs.response_task(hs.BoucWen(beta=0.02, gamma=-0.01, gain=0.01, feedthrough=0.02), rec.u, rec.y)
    >>> result = hs.sweep(task, {"beta": [0.01, 0.02], "feedthrough": [0.01, 0.02, 0.03]})
    >>> len(result), result["rmse"].shape
    (6, (6,))
    """
    check_choice("measure", measure, get_args(Measure))
    law = model_of(law)
    family = law if isinstance(law, type) else type(law)
    reduces = isinstance(family, _ComputesMany) and "reduce" in inspect.signature(family.responses).parameters
    if not (isinstance(family, _ComputesMany) and (reduces or measure == "response")):
        raise TypeError(f"{family.__name__} cannot compute many laws at once with the measure {measure!r}")
    if (measure in _WITH_TARGET) != (y is not None):
        raise ValueError(f"y is needed for the measures {' and '.join(_WITH_TARGET)}, and for no other")
    fixed = {} if isinstance(law, type) else {k: v for k, v in given_items(law).items() if k != "u_range"}
    inputs, *target = vectors(u=u) if y is None else vectors(u=u, y=y)
    return ResponseTask(family=family, fixed=fixed, u=inputs, y=target[0] if target else None, measure=measure)
