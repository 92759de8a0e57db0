"""Columns in which the output of an actuator is affine: those of its law, through everything behind it.

The law sees the voltage, at the ends of sub-steps where an amplifier takes time. What is behind it is linear and begins
at rest, so that each column passes through it by itself, exactly as an `Actuator` passes it (`hysim.plants.chain`).
Of many sets of parameters those that share the law's, or those of the other parts, share the work on them.
"""

import functools
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray
from hysim._parallel import in_chunks
from hysim.kernels.actuators import columns as kernels
from hysim.models.search_space import Parameters
from hysim.plants.amplifier import Amplifier
from hysim.plants.chain import Chain
from hysim.plants.whole.linear_parts import Stages
from hysim.records import Record

Rows = npt.NDArray[np.intp]
_SETS_PER_THREAD = 2


def columns_through(
    law: Any,
    law_parameters: Parameters,
    parts: Parameters,
    stages: Callable[[Mapping[str, float]], Stages],
    record: Record,
) -> FloatArray:
    """Columns (n_sets, n_samples, n_columns + 1) for the law's parameters and those of the other parts."""
    step = record.sample_time
    n_sets = max((np.size(value) for value in (*law_parameters.values(), *parts.values())), default=1)
    own, of_law = _distinct(law_parameters, n_sets)
    values, of_parts = _distinct(parts, n_sets)
    chains = [_chain(stages(each), step) for each in values]
    drives = [_voltage(chain, record.u) for chain in chains]
    blocks: dict[tuple[int, int], FloatArray] = {}
    for drive, mine in _by_drive(drives, of_law, of_parts):
        chosen = {name: np.array([own[k][name] for k in mine]) for name in law_parameters}
        columns = law.regressors(chosen, Record(u=drives[drive], y=drives[drive], t=_times(drives[drive], record)))
        columns = np.broadcast_to(columns, (len(mine), *columns.shape[1:]))
        blocks |= {(drive, k): np.ascontiguousarray(block.T) for k, block in zip(mine, columns, strict=True)}
    first = _first_of_equal(drives)
    n_columns = len(next(iter(blocks.values())))
    pairs, which = np.unique(np.stack([of_parts, of_law], axis=1), axis=0, return_inverse=True)
    out = np.empty((len(pairs), n_columns, len(record)))

    def work(start: int, stop: int) -> None:
        for k in range(start, stop):
            part, own_law = pairs[k].tolist()
            _pass(chains[part], blocks[first[part], own_law], out[k])

    in_chunks(work, len(pairs), minimum=_SETS_PER_THREAD, n_samples=len(record))
    return np.asarray(out[np.ravel(which)].transpose(0, 2, 1))


def _pass(chain: Chain, w: FloatArray, out: FloatArray) -> None:
    """Columns `w` (n_columns, n_fine) through the stage behind the law; constant ones have its gain at rest."""
    stage, row = chain.stage, chain.output_row
    gain = float(row[0] + row[1] + row[2] + row[3:] @ stage.rest)
    still = (w == w[:, :1]).all(axis=1)
    out[still] = gain * w[still, :1]
    if not still.all():
        moving = np.empty((int(np.count_nonzero(~still)), out.shape[1]))
        kernels.through(stage.decline, stage.A, stage.B, row, stage.rest, stage.lag, chain.substeps, w[~still], moving)
        out[~still] = moving


def _distinct(parameters: Parameters, n_sets: int) -> tuple[list[dict[str, float]], Rows]:
    """The sets that differ, by name, and which of them each set is."""
    names = list(parameters)
    if not names:
        return [{}], np.zeros(n_sets, dtype=np.intp)
    table = np.stack([np.broadcast_to(np.ravel(parameters[name]), n_sets) for name in names], axis=1)
    rows, which = np.unique(table, axis=0, return_inverse=True)
    return [dict(zip(names, row, strict=True)) for row in rows.tolist()], np.ravel(which)


@functools.lru_cache(maxsize=64)
def _chain(stages: Stages, step: float) -> Chain:
    """The stages at a sample time; where inputs are compared, they are the same for all of them."""
    return Chain(
        amplifier=stages.amplifier,
        hysteresis=None,
        creep=stages.creep,
        vibration=stages.vibration,
        sensor=None,
        sample_time=step,
    )


def _voltage(chain: Chain, u: FloatArray) -> FloatArray:
    """The voltage at the law, at the end of each sub-step."""
    amplifier: Amplifier = chain.amplifier
    if not amplifier.dynamic:
        return amplifier.voltage(u)
    return chain.driven(u, chain.rest(float(u[0])))[0].v


def _times(drive: FloatArray, record: Record) -> FloatArray:
    """Times of the ends of sub-steps."""
    return record.sample_time * len(record) / drive.size * np.arange(float(drive.size))


def _first_of_equal(drives: list[FloatArray]) -> list[int]:
    """For each voltage the first one that is equal to it."""
    return [next(j for j, other in enumerate(drives) if np.array_equal(drive, other)) for drive in drives]


def _by_drive(drives: list[FloatArray], of_law: Rows, of_parts: Rows) -> list[tuple[int, list[int]]]:
    """Each different voltage, and the laws that see it."""
    first = np.array(_first_of_equal(drives))
    pairs = {(int(drive), int(k)) for drive, k in zip(first[of_parts], of_law, strict=True)}
    return [(drive, sorted(k for d, k in pairs if d == drive)) for drive in sorted({drive for drive, _ in pairs})]
