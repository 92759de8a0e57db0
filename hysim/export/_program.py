"""A step in C99 with its numbers: what a C source, a functional mock-up unit and a page are made of."""

from typing import NamedTuple

from hysim._frozen import FloatArray, frozen


class Field(NamedTuple):
    """A number of a model that may still be changed where the program runs.

    `lower` and `upper` are the box of a slider or of a tunable parameter; `log` says that its scale is logarithmic.
    """

    name: str
    value: float
    lower: float
    upper: float
    log: bool = False
    unit: str = ""


@frozen
class Program:
    """C99 functions of a step, and the numbers that they take.

    Parameters
    ----------
    source : str
        C99 text that needs the C library's `math.h` alone: static functions and tables.
    step : str
        Name of the function ``double step(const double *parameters, double *state, double u)``; a controller has
        ``reference`` and ``measurement`` in place of `u`. The state moves along.
    inputs : tuple of str
        Names of the inputs, ``("u",)`` or ``("reference", "measurement")``.
    output : str
        Name of the output.
    parameters : array, shape (n_parameters,)
        Constants of the step.
    state : array, shape (n_state,)
        State before the first sample.
    start : str
        Name of the function ``void start(const double *parameters, double *state, double u0)`` that completes `state`
        for a first input `u0`; empty where `state` is complete.
    fields : tuple of Field
        Numbers that may be changed before a start.
    pack : str
        Name of the function ``void pack(const double *fields, double *parameters, double *state)`` that writes
        `parameters` and the front of `state` from the fields; empty where there are none.
    memory : int
        Places at the front of the state that are the input and the memory; the rest is room for work.
    sample_time : float
        Time between two samples [s]; nan for a law that does not depend on time.
    """

    source: str
    step: str
    inputs: tuple[str, ...]
    output: str
    parameters: FloatArray
    state: FloatArray
    start: str = ""
    fields: tuple[Field, ...] = ()
    pack: str = ""
    memory: int = 0
    sample_time: float = float("nan")
