"""Survey of the records of an actuator before anything is identified: their rates, and which is for which part."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hysim.records import Record

_WIDE = 0.8  # of the widest span of inputs: a record with less does not show the law
_FEWEST = 8  # samples


@dataclass(frozen=True)
class Survey:
    """Rates of several records; times in seconds.

    `law` is the record on which the law is searched: the slowest among those of a wide input. `fastest` is that of the
    shortest sample time, among equal ones that of the fastest input. `duration` is its duration.
    """

    law: int
    fastest: int
    shortest: float
    longest: float
    duration: float

    @property
    def nyquist(self) -> float:
        """Half the highest sampling rate [rad/s]."""
        return float(np.pi / self.shortest)

    @classmethod
    def of(cls, records: Sequence[Record]) -> "Survey":
        """Raises ValueError for a record without time, with uneven steps, or too short, and where no input moves."""
        steps = [_even_step(record, k, len(records)) for k, record in enumerate(records)]
        durations = [step * len(record) for step, record in zip(steps, records, strict=True)]
        spans = [float(np.ptp(record.u)) for record in records]
        if max(spans) == 0.0:
            raise ValueError("the input is constant: nothing can be identified from it")
        speeds = [float(np.abs(np.diff(r.u)).sum()) / d for r, d in zip(records, durations, strict=True)]
        wide = [k for k, span in enumerate(spans) if span >= _WIDE * max(spans)]
        fastest = min(range(len(records)), key=lambda k: (steps[k], -speeds[k]))
        return cls(
            law=min(wide, key=lambda k: speeds[k]),
            fastest=fastest,
            shortest=min(steps),
            longest=max(durations),
            duration=durations[fastest],
        )


def _even_step(record: Record, k: int, n: int) -> float:
    owner = f"record {k}{f' ({record.name})' if record.name else ''}" if n > 1 else "the record"
    if record.t is None:
        raise ValueError(f"{owner} has no time, which an actuator needs: Record(t=..., u=..., y=...)")
    if len(record) < _FEWEST:
        raise ValueError(f"{owner} has {len(record)} samples: an actuator needs at least {_FEWEST}")
    try:
        return record.sample_time
    except ValueError as error:
        raise ValueError(f"{owner} is not sampled evenly: use Record.resample ({error})") from None
