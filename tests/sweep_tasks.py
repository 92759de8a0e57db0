"""Tasks of the tests of `sweep`, importable in other processes."""

import os
import threading

import numpy as np

import hysim as hs

SPACE = {"a": np.linspace(0.1, 2.0, 20), "b": [1, 2, 3], "way": ["up", "down"]}


def noisy(a, b, way, seed):
    """Two numbers, one of them nan now and then and one a signed zero, and an array."""
    rng = np.random.default_rng(seed)
    path = rng.standard_normal(50).cumsum() * (1.0 if way == "up" else -1.0)
    return {"last": path[-1] + a * b, "odd": float("nan") if b == 2 else -0.0, "path": path[::10]}


def product(a, b):
    return a * b


def products(a, b):
    return {"value": a * b}


def with_batch(a, b):
    return a * b


with_batch.batch = products


def identified(k):
    """The error of a fit."""
    return hs.identify(hs.Play, hs.Record(u=[0, 1, 2, 1, 0], y=[0, 1, 2, 1.5, 0.5 * k])).rmse


def failing(a, b):
    if a == 3:
        raise ValueError(f"no {a}")
    return a / b


def long(a, b, seed):
    """Some milliseconds."""
    return {"largest": np.random.default_rng(seed).standard_normal(30_000).cumsum().max() + a, "both": [a, b]}


LONG = {"a": range(120), "b": [1.0, 2.0]}


def run_until_killed(store, n_done, delay):
    """Run `long` with two threads, and kill this process `delay` seconds after so many tasks are done."""

    def watch(done, total):
        if n_done <= done < total:
            threading.Timer(delay, os.kill, (os.getpid(), 9)).start()

    hs.sweep(long, LONG, workers=2, store=store, progress=watch)
