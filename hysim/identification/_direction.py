"""Whether a family finds that the input and the output of a record were swapped.

The output of an actuator lags its input: its loop runs counterclockwise, and clockwise where the columns were swapped.
A force that a displacement takes runs clockwise too, so that the sense alone proves nothing. It is doubted where the
same family fits well from y to u and clearly better than from u to y, since a family that describes an actuator leaves
more in reverse: noise on what is then the input makes reversals that never were, and few hysteresis laws are closed
under inversion. The reverse fit is a short one, on at most 500 samples, and only of clockwise records; it reaches an
upper bound of the error, so that it may overlook swapped columns but hardly accuses right ones. On a counterclockwise
record, which a swapped force and displacement give, nothing is said: families that are wrong for a material fit it
better in reverse as often as not.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hysim import metrics
from hysim.errors import SimulationError
from hysim.identification._problem import problem
from hysim.identification._search import brief_cost
from hysim.identification.sentences import SWAPPED
from hysim.models.protocols import Identifiable
from hysim.models.search_space import Freedom
from hysim.records import Record

_MOST_SAMPLES = 500
_BETTER = 0.8  # of the forward error: a reverse fit that is better by chance, or by a parameter, is not
_GOOD = 0.1  # of the standard deviation: a reverse model that is worse describes nothing
_PERFECT = 1e-3  # forward errors below this leave nothing to suspect


def swapped_for(
    family: Identifiable, records: Sequence[Record], freedom: Freedom, initial: str | Sequence[str] | None, error: float
) -> str:
    """A sentence where the family fits the first record better from y to u; else the empty text.

    `error` is the rms of the forward residual over the standard deviation of the output.
    """
    record = records[0]
    if len(records) > 1 or not error > _PERFECT or not _is_clockwise(record):
        return ""
    reverse = replace(record, u=record.y, y=record.u, resolution=None, units={})[:: -(-len(record) // _MOST_SAMPLES)]
    try:
        whole = problem(family, [reverse], freedom, initial)
        if len(whole.space.names) >= len(reverse):
            return ""
        cost = brief_cost(whole)
    except (ValueError, TypeError, ArithmeticError, SimulationError):
        return ""  # what cannot be fitted in reverse was not swapped
    other = float(np.sqrt(cost / len(reverse)) / np.std(reverse.y))
    if not other < min(_BETTER * error, _GOOD):
        return ""
    return (
        f"{SWAPPED}: from y to u the same family leaves an error of {100.0 * other:.2g} % instead of "
        f"{100.0 * error:.2g} %, and the loop runs counterclockwise as an actuator's does; check the columns"
    )


def _is_clockwise(record: Record) -> bool:
    try:
        return metrics.loop_metrics(record.u, record.y).orientation == "clockwise"
    except ValueError:  # there is no complete cycle
        return False
