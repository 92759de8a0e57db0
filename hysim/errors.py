"""The errors of hysim; wrong arguments raise the built-in `ValueError` or `TypeError`."""

import warnings
from typing import Any, Protocol, runtime_checkable

_LIMITED = 0.05  # of the samples: a limit that is touched at the corners of a reference is not worth a word
_BEYOND = 0.01  # of the identified range: a law does not change within so little
_CLOSED = 4  # frames above a warning of `close_loop`: of this module, of the loop, of `reports` around it, the caller's


class SimulationError(RuntimeError):
    """A simulation diverged; the message names the sample or the time."""


class HysimWarning(UserWarning):
    """A result that is computed as asked, and may not be what the device does."""


def warn_beyond(u_range: tuple[float, ...] | None, u: Any, name: str, *, stacklevel: int = _CLOSED) -> None:
    """Warn once if an input `u` (n,) leaves the range that a model of this `name` was identified on."""
    if u_range is None or not u.size:
        return
    low, high = u_range
    lowest, highest = float(u.min()), float(u.max())
    if max(low - lowest, highest - high) > _BEYOND * (high - low):
        ranges = f"from {lowest:.4g} to {highest:.4g}, but the {name} was identified from {low:.4g} to {high:.4g}"
        words = f"the input goes {ranges}: what it says beyond is extrapolated"
        warnings.warn(words, HysimWarning, stacklevel=stacklevel)


@runtime_checkable
class _Doubted(Protocol):
    """A result that says where its model is not safe."""

    @property
    def unsafe(self) -> str: ...


def warn_unsafe(thing: Any) -> None:
    """Warn where the model of a result that is to drive a device runs away on smaller cycles."""
    if isinstance(thing, _Doubted) and thing.unsafe:
        warnings.warn(thing.unsafe, HysimWarning, stacklevel=3)


def warn_limited(limited: int, samples: int, *, may_invert: bool, jumps: int = 0) -> None:
    """Warn if a command stands at a limit for more than 5 % of its samples, maybe of a law that `may_invert`.

    `jumps` are those from one limit to the other, between two samples.
    """
    if limited > _LIMITED * samples:
        at_limit = f"the command is at a limit of the controller or the amplifier in {limited} of {samples} samples"
        turns = ", or the slope of an inverted law changes its sign before, which inverse_response names"
        reason = f"the reference is out of reach there{turns if may_invert else ''}"
        if jumps > _LIMITED * samples:
            reason = "it jumps from one to the other, as an unstable loop does: hs.control.assess_loop says so"
        warnings.warn(f"{at_limit}: {reason}", HysimWarning, stacklevel=_CLOSED)


class Interrupted(KeyboardInterrupt):
    """Ctrl-C after a part of the work was done; `finished` is the result of that part."""

    def __init__(self, message: str, finished: Any) -> None:
        super().__init__(message)
        self.finished = finished
