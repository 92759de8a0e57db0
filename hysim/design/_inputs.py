"""Inputs by their turning points, and the usual inputs with which a design is compared.

Strokes (n_strokes, 3): turning point about the centre, time held there [s], and speed on the way to it / full slew.
"""

import math

import numpy as np

from hysim._basics.frozen import FloatArray, Positive, checked


@checked
class InputLimits:
    """Limits of an input.

    Parameters
    ----------
    amplitude, slew : float
        Largest distance of the input from the centre [unit of u], and largest size of its rate [unit of u / s].
    duration, sample_time : float
        Length of the record, and time between two samples [s].
    centre : float
        Where the input begins [unit of u].

    Raises
    ------
    ValueError
        If a number is not positive, or the record holds fewer than ten samples.

    Examples
    --------
    >>> import hysim as hs
    >>> hs.InputLimits(amplitude=2.0, slew=4.0, duration=10.0, sample_time=0.1).samples
    101
    """

    amplitude: Positive
    slew: Positive
    duration: Positive
    sample_time: Positive
    centre: float = 0.0

    def __post_init__(self) -> None:
        if self.samples < 10:
            raise ValueError(f"the record must hold at least 10 samples, got {self.samples}")

    @property
    def samples(self) -> int:
        """Number of samples."""
        return 1 + math.floor(self.duration / self.sample_time * (1.0 + 1e-12))

    @property
    def t(self) -> FloatArray:
        """Times of the samples [s], shape (samples,)."""
        return np.asarray(np.arange(self.samples) * self.sample_time, dtype=float)

    @property
    def stride(self) -> float:
        """Largest change of the input from sample to sample [unit of u]."""
        return self.slew * self.sample_time

    def fitted(self, u: FloatArray) -> FloatArray:
        """An input (samples,) within the limits that follows `u` as fast as the slew allows, from the centre on."""
        low, high = self.centre - self.amplitude, self.centre + self.amplitude
        inside, kept, last = np.clip(u, low, high), np.empty(u.size), self.centre
        for k, wanted in enumerate(inside.tolist()):
            last = min(max(wanted, last - self.stride), last + self.stride)
            kept[k] = last
        return kept


_HOLD = 0.02  # of the record, a pause at a turning point in the mean
_TONES = (1, 3, 5, 7, 11)  # multiples of the lowest frequency of a multisine
_SEGMENTS = (1, 2, 4, 8)  # of an input to a plant that depends on time
_SLOWEST = 2.0  # decades below the full slew, in which the speed of a segment is drawn
_SHORTER = 1.0  # decades below _HOLD, likewise
_SHORTEST, _LONGEST = 0.02, 0.5  # of the record, a segment that is drawn anew
_SPEEDS = (1.0, 0.3, 0.1, 0.03, 0.01)  # of usual inputs, in parts of the full slew


def through(strokes: FloatArray, limits: InputLimits) -> FloatArray:
    """The input (samples,) through the turning points, each held for its time, cut off at the end of the record."""
    levels, holds, speeds = strokes.T
    times = np.abs(np.diff(levels, prepend=0.0)) / (limits.slew * speeds)
    places = np.concatenate([[0.0], np.cumsum(np.column_stack([times, holds]).ravel())])
    return np.asarray(limits.centre + np.interp(limits.t, places, np.append(0.0, np.repeat(levels, 2))))


def usual(limits: InputLimits) -> dict[str, list[FloatArray]]:
    """A triangle, one that fades and a multisine, each as large and as fast as the limits allow."""
    cycles = _cycles(limits)
    time, reach = limits.t / limits.duration, np.zeros(limits.samples)
    for k, tone in enumerate(_TONES):
        reach = reach + np.sin(2.0 * np.pi * max(1, round(cycles / 2.0)) * tone * time + np.pi * k**2 / len(_TONES))
    return {
        "triangle": [through(triangle(limits), limits)],
        "fading triangle": [through(triangle(limits, fading=True), limits)],
        "multisine": [limits.fitted(limits.centre + limits.amplitude * reach / float(np.abs(reach).max()))],
    }


def usual_of_many_speeds(limits: InputLimits, highest: float, rng: np.random.Generator) -> dict[str, list[FloatArray]]:
    """As `usual` at several speeds, and random-phase multisines up to `highest` [Hz], of equal and of falling tones."""
    return {
        "triangle": [through(each, limits) for each in triangles(limits)],
        "fading triangle": [through(each, limits) for each in triangles(limits, fading=True)],
        "multisine": [_multisine(limits, highest, power, rng) for power in (0.0, -1.0)],
    }


def triangles(limits: InputLimits, *, fading: bool = False) -> list[FloatArray]:
    """Strokes of triangles of several speeds that have more than a cycle in the record, or else the fastest."""
    speeds = [speed for speed in _SPEEDS if _cycles(limits, speed) > 1.0] or [1.0]
    return [triangle(limits, speed, fading=fading) for speed in speeds]


def triangle(limits: InputLimits, speed: float = 1.0, *, fading: bool = False) -> FloatArray:
    """Strokes of a triangle of the full amplitude, or of one that fades to nothing."""
    count = max(2, round(2.0 * _cycles(limits, speed)))
    levels = limits.amplitude * np.where(np.arange(2 * count) % 2 == 0, 1.0, -1.0)
    if fading:
        levels *= np.linspace(1.0, 0.0, 2 * count, endpoint=False)
    return np.column_stack([levels, np.zeros(levels.size), np.full(levels.size, speed)])


def _cycles(limits: InputLimits, speed: float = 1.0) -> float:
    by_slew = limits.duration * speed * limits.slew / (4.0 * limits.amplitude)
    return max(1.0, min(by_slew, 0.5 * limits.duration / limits.sample_time))


def _multisine(limits: InputLimits, highest: float, power: float, rng: np.random.Generator) -> FloatArray:
    tones = np.arange(1, max(2, 1 + min(int(highest * limits.duration), (limits.samples - 1) // 2)))
    spectrum = np.zeros(limits.samples // 2 + 1, dtype=complex)
    spectrum[tones] = tones**power * np.exp(2j * np.pi * rng.random(tones.size))
    reach = np.fft.irfft(spectrum, limits.samples)
    largest = min(limits.amplitude / np.abs(reach).max(), limits.stride / np.abs(np.diff(reach)).max())
    return limits.fitted(limits.centre + largest * reach)


def random_strokes(limits: InputLimits, rng: np.random.Generator) -> FloatArray:
    """Strokes at the full slew to alternate sides that fill the record; some inputs have short ones, or many holds."""
    is_at_once = limits.slew * limits.sample_time > 2.0 * limits.amplitude  # a stroke, within a sample
    least = limits.sample_time if is_at_once else 0.0
    return _segment(limits, rng, 0.0, limits.duration, _HOLD * limits.duration, speed=1.0, least=least)


def random_segments(limits: InputLimits, rng: np.random.Generator) -> FloatArray:
    """Strokes of several segments, each with lengths, speeds and holds of its own, to fill the record."""
    count = int(rng.choice(_SEGMENTS))
    strokes = np.empty((0, 3))
    for end in np.append(np.sort(rng.random(count - 1)), 1.0):
        lasting = end * limits.duration - float(_times(strokes, limits).sum())
        if lasting > 0.0:
            strokes = np.concatenate([strokes, random_segment(limits, rng, _last(strokes), lasting)])
    return strokes


def random_segment(limits: InputLimits, rng: np.random.Generator, last: float, lasting: float) -> FloatArray:
    """Strokes of one length, speed and share of holds, from a level `last` on, for a time [s]."""
    hold = _HOLD * limits.duration * 10.0 ** (-_SHORTER * float(rng.random()))
    speed = 10.0 ** (-_SLOWEST * float(rng.random()))
    return _segment(limits, rng, last, lasting, hold, speed, least=limits.sample_time)


def with_another_segment(
    strokes: FloatArray, limits: InputLimits, rng: np.random.Generator, progress: float = 0.0
) -> FloatArray:
    """The strokes with a random stretch drawn anew, of whatever length at any progress of the search."""
    ends = np.cumsum(_times(strokes, limits))
    lasting = limits.duration * _SHORTEST * (_LONGEST / _SHORTEST) ** float(rng.random())
    begin = float(rng.random()) * (limits.duration - lasting)
    first, behind = np.searchsorted(ends, [begin, begin + lasting])
    before = strokes[:first]
    segment = random_segment(limits, rng, _last(before), lasting)
    return np.concatenate([before, segment, strokes[behind:]])


def _times(strokes: FloatArray, limits: InputLimits) -> FloatArray:
    return np.asarray(np.abs(np.diff(strokes[:, 0], prepend=0.0)) / (limits.slew * strokes[:, 2]) + strokes[:, 1])


def _last(strokes: FloatArray) -> float:
    return float(strokes[-1, 0]) if len(strokes) else 0.0


def _segment(
    limits: InputLimits, rng: np.random.Generator, last: float, lasting: float, pause: float, speed: float, least: float
) -> FloatArray:
    """Strokes of a speed to alternate sides, each with its hold at least of a duration [s]."""
    rows, bias, held = [], float(rng.uniform(0.3, 3.0)), float(rng.choice([0.0, 0.2, 0.6]))
    time, side = 0.0, 1.0 if rng.random() < 0.5 else -1.0
    while time < lasting:
        level = last + (side * limits.amplitude - last) * float(rng.random()) ** bias
        hold = float(rng.exponential(pause)) if rng.random() < held else 0.0
        moving = abs(level - last) / (limits.slew * speed)
        hold = max(hold, least - moving)
        time, last, side = time + moving + hold, level, -side
        rows.append((level, hold, speed))
    return np.array(rows)
