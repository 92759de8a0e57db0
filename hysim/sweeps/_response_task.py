"""A law over its parameters, as a task with a batch form."""

import inspect
from collections.abc import Mapping
from dataclasses import fields
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, checked, read_only

Measure = Literal["rmse", "sse", "max_width", "area", "final", "response"]
_OF_A_TARGET = ("rmse", "sse")


@checked
class ResponseTask:
    """What `response_task` returns: parameters of a law in, one measure of its response out.

    Parameters
    ----------
    family : type
        Of the law.
    held : mapping
        Parameters of the law that the study does not name, to their values.
    u : array, shape (n,)
        Input.
    y : array, shape (n,), optional
        What the response is compared with.
    measure : str
        See `response_task`.
    """

    family: type
    held: Mapping[str, Any]
    u: FloatArray
    y: FloatArray | None
    measure: Measure

    def __call__(self, **parameters: float) -> dict[str, Any]:
        """The measure for one set of parameters, or the response, shape (n,), by its name."""
        return {name: values[0] for name, values in self.batch(**{k: [v] for k, v in parameters.items()}).items()}

    def batch(self, **parameters: npt.ArrayLike) -> dict[str, FloatArray]:
        """The measures for many sets, shape (n_sets,), or the responses, shape (n_sets, n), by their name."""
        laws: Any = self.family
        sets = {**self.held, **parameters}
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
    law : law or class
        A law, whose values hold for every parameter that the study does not name; or its class, with its defaults.
    u : array, shape (n,)
        Input, linear between its samples.
    y : array, shape (n,), optional
        With ``"rmse"`` and ``"sse"`` what the response is compared with.
    measure : {"rmse", "sse", "max_width", "area", "final", "response"}
        Root of the mean, or sum, of the squared differences from `y`; a measure of `loop_metrics` (last complete
        cycle); the last sample; or the response itself as an array. inf for a law that escapes.

    Returns
    -------
    ResponseTask
        A function of the law's parameters, whose batch form computes many sets at once, as the family's
        ``responses`` does, on one thread.

    Raises
    ------
    TypeError
        If the law has no ``responses``, or none with this measure.
    ValueError
        If there is no such measure, `y` is missing or has nothing to be compared with, or the lengths differ.

    Examples
    --------
    >>> import hysim as hs
    >>> rec = hs.datasets.table1()
    >>> task = hs.response_task(hs.BoucWen(beta=0.02, gamma=-0.01, gain=0.01, feedthrough=0.02), rec.u, rec.y)
    >>> result = hs.sweep(task, {"beta": [0.01, 0.02], "feedthrough": [0.01, 0.02, 0.03]})
    >>> len(result), result["rmse"].shape
    (6, (6,))
    """
    if measure not in get_args(Measure):
        raise ValueError(f"measure must be one of {', '.join(get_args(Measure))}, got {measure!r}")
    family = law if isinstance(law, type) else type(law)
    responses = getattr(family, "responses", None)
    if responses is None or (measure != "response" and "reduce" not in inspect.signature(responses).parameters):
        raise TypeError(f"{family.__name__} computes no many laws at once with the measure {measure!r}")
    if (measure in _OF_A_TARGET) != (y is not None):
        raise ValueError(f"{' and '.join(_OF_A_TARGET)} take y to compare with, and nothing else does")
    held = {} if isinstance(law, type) else {field.name: getattr(law, field.name) for field in fields(law)}
    inputs = read_only(u, "u", ndim=1)
    target = None if y is None else read_only(y, "y", ndim=1)
    if target is not None and target.size != inputs.size:
        raise ValueError(f"u and y must have equal lengths, got {inputs.size} and {target.size}")
    return ResponseTask(family=family, held=held, u=inputs, y=target, measure=measure)
