"""One seed for each task, from the study's seed and the task's place alone.

Task k has the seed of ``numpy.random.SeedSequence(seed).spawn(n)[k]``,

    SeedSequence(seed, spawn_key=(k,)).generate_state(1, np.uint64) >> 1.

NumPy needs 10 us for each; here they are computed for all tasks at once by its algorithm, M. E. O'Neill's
``seed_seq_fe``, which NumPy keeps stable. One bit is dropped because SQL has no unsigned integers.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

_POOL = 4  # words
_WORD = 0xFFFFFFFF
Words = Any
"""One word, an int or an array of uint64, below 2^32."""


def seeds(seed: int, places: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Seeds of the tasks at these places, shape (n,); TypeError or ValueError unless `seed` is an integer from 0 on."""
    if isinstance(seed, bool) or not isinstance(seed, (int, np.integer)):
        raise TypeError(f"seed must be an integer, got {seed!r}")
    if seed < 0:
        raise ValueError(f"seed must be at least 0, got {seed}")
    low, high = _state(_pool([*_words(int(seed)), places.astype(np.uint64)]))
    return np.asarray((high << 32 | low) >> 1, dtype=np.int64)


def _words(seed: int) -> list[Words]:
    """Words of 32 bits, the lowest first, filled up to the pool."""
    words = [seed & _WORD]
    while seed := seed >> 32:
        words.append(seed & _WORD)
    return words + [0] * (_POOL - len(words))


def _pool(entropy: list[Words]) -> list[Words]:
    hashed = _Hash(0x43B0D7E5, 0x931E8875)
    pool = [hashed(word) for word in entropy[:_POOL]]
    for source in range(_POOL):
        for target in range(_POOL):
            if source != target:
                pool[target] = _mixed(pool[target], hashed(pool[source]))
    for word in entropy[_POOL:]:
        pool = [_mixed(old, hashed(word)) for old in pool]
    return pool


def _state(pool: list[Words]) -> tuple[Words, Words]:
    hashed = _Hash(0x8B51F9DD, 0x58F38DED)
    return hashed(pool[0]), hashed(pool[1])


class _Hash:
    """Hash of one word after the other, by a constant that changes from word to word."""

    def __init__(self, start: int, factor: int) -> None:
        self.constant, self.factor = start, factor

    def __call__(self, word: Words) -> Words:
        word = word ^ self.constant
        self.constant = self.constant * self.factor & _WORD
        word = word * self.constant & _WORD
        return word ^ word >> 16


def _mixed(one: Words, other: Words) -> Words:
    word = (one * 0xCA01F9DD + (_WORD + 1) - (other * 0x4973F715 & _WORD)) & _WORD
    return word ^ word >> 16
