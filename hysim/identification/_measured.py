"""The model that is returned: with the filter of its input, the start of its record, and its own residual."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from hysim import metrics
from hysim._basics.frozen import FloatArray
from hysim.errors import SimulationError
from hysim.identification._assumptions import Treated
from hysim.identification._result import Candidate, Identification
from hysim.laws.operators.reversal_filter import ReversalFilter
from hysim.models.cascade import Cascade
from hysim.models.protocols import placed
from hysim.plants.actuator import Actuator
from hysim.plants.multi_input_actuator import MultiInputActuator
from hysim.records import Record
from hysim.simulation import free_run

_UNUSABLE = 2.0  # times the error along a quiet path: beyond, the noise of the input decides what the model does


def as_measured(
    fit: Identification, records: Sequence[Record], weights: Sequence[FloatArray] | None, treatment: Treated
) -> Identification:
    """The result with models that begin where the records begin, and the residual of these models."""
    lowest, highest = min(float(each.u.min()) for each in records), max(float(each.u.max()) for each in records)

    def returned(model: Any, record: Record) -> Any:
        return placed(_behind(treatment.front, model), float(record.u[0]), (lowest, highest))

    def candidate(each: Candidate) -> Candidate:
        return replace(each, model=returned(each.model, records[0]))

    models = tuple(returned(model, record) for model, record in zip(fit.models, records, strict=True))
    y = np.concatenate([record.y for record in records])
    residual = y - np.concatenate([free_run(model, record).y for model, record in zip(models, records, strict=True)])
    kept = np.ones(y.size, dtype=bool) if weights is None else np.concatenate([*weights]) > 0.0
    front = {} if treatment.front is None else {"reversal_filter.threshold": treatment.front.threshold}
    return replace(
        fit,
        model=models[0],
        models=models,
        estimates={**fit.estimates, **front},
        residual=residual,
        fit_percent=metrics.fit_percent(y[kept], (y - residual)[kept]),
        rmse=metrics.rmse(residual[kept], 0.0 * residual[kept]),
        rivals=tuple(candidate(each) for each in fit.rivals),
        regions={name: candidate(each) for name, each in fit.regions.items()},
        least_squares=None if fit.least_squares is None else candidate(fit.least_squares),
    )


def said_of_noise(
    fit: Identification, records: Sequence[Record], treatment: Treated, quiet_rmse: float
) -> Identification:
    """The result with what was done to a noisy input, and whether the model is of use on it."""
    if not treatment.noises:
        return fit
    size, span = max(treatment.noises), max(float(np.ptp(record.u)) for record in records)
    words = [f"input noise {size:.2g} rms ({100.0 * size / span:.2g} % of its span)"]
    if treatment.front is None:
        words.append("the law follows the input as measured, and predicts parts left out as well as behind a filter")
    else:
        pairs = zip(treatment.records, records, strict=True)
        turns = ", ".join(f"{each.reversals().size} of {raw.reversals().size}" for each, raw in pairs)
        words.append(f"fitted along {turns} reversals")
        words.append(f"the model includes a filter of reversals up to {treatment.front.threshold:.3g}")
        spread = float(np.ptp(np.concatenate([record.y for record in records])))
        alone = [placed(_alone(model), float(record.u[0])) for model, record in zip(fit.models, records, strict=True)]
        words.append(
            f"error on the record as measured {100.0 * fit.rmse / spread:.3g} % of its range, "
            f"{_alone_in_words(alone, records, spread)} without the filter"
        )
    message = f"{fit.message}; {', '.join(words)}"
    if fit.rmse <= _UNUSABLE * quiet_rmse:
        return replace(fit, message=message)
    unusable = (
        f"NOT USABLE on this input: its noise of {size:.2g} rms makes an error of {fit.rmse:.3g}, "
        f"{fit.rmse / quiet_rmse:.2g} times that along a path without noise"
    )
    return replace(fit, success=False, message=f"{unusable}; {message}")


def _alone_in_words(models: Sequence[Any], records: Sequence[Record], spread: float) -> str:
    try:
        residual = [record.y - free_run(model, record).y for model, record in zip(models, records, strict=True)]
    except SimulationError:
        return "and it diverges"
    return f"{100.0 * float(np.sqrt(np.mean(np.concatenate(residual) ** 2))) / spread:.3g} %"


def _behind(front: ReversalFilter | None, model: Any) -> Any:
    """A model after a filter of its input; in an actuator the filter of the voltage stands in front of the law."""
    if front is None:
        return model
    if isinstance(model, Actuator) and model.amplifier is not None:
        front = ReversalFilter(threshold=abs(model.amplifier.gain) * front.threshold)
    return _with_law(model, lambda law: front >> law)


def _alone(model: Any) -> Any:
    return _with_law(model, lambda law: law.behind_filter)


def without_filter(model: Any, records: Sequence[Record]) -> tuple[Any, Sequence[Record]]:
    """A law without the filter of its input, from the first sample, and the records as the law sees them."""
    if not isinstance(model, Cascade) or model.behind_filter is model:
        return placed(model, None), records
    front = placed(model.stages[0], None)
    return placed(model.behind_filter, None), [replace(record, u=front.response(record.u)) for record in records]


def _with_law(model: Any, changed: Callable[[Any], Any]) -> Any:
    """A law changed; of an actuator its own, of several that of the input ``"u"``."""
    if isinstance(model, MultiInputActuator):
        pairs = zip(model.inputs, model.actuators, strict=True)
        return replace(
            model, actuators=tuple(_with_law(each, changed) if name == "u" else each for name, each in pairs)
        )
    return replace(model, hysteresis=changed(model.hysteresis)) if isinstance(model, Actuator) else changed(model)
