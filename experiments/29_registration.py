"""How far off is a displacement that is measured from camera frames, and does its standard error say so?

Four kinds of picture, none of them used while the method was made, are moved by exact shifts over a whole pixel, with
content that enters and leaves, under noise of 40 to 10 dB below the picture. Beside `hs.vision.displacement` and its
whole pixels stands what scikit-image's upsampled cross-correlation gives by itself under a window, with phases alone
and plain.

Speed and memory: 512 x 512 pixels of 8 bits, made while they are measured, on one thread in a process of its own. The
time is that of the processor.
"""

import json
import math
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

import hysim as hs
from hysim.plot import Figure, figure

sys.path.insert(0, str(Path(__file__).parent))
from results_folder import write_results

RESULTS = Path(__file__).parent / "results" / "registration"
SIZE, DRAWS, SHIFTS = 128, 16, np.linspace(0.0, 1.0, 11)
DECIBELS = (40, 30, 20, 10)
OWN, WHOLE, PHASE, PLAIN = "hysim", "whole pixels", "scikit-image, phase", "scikit-image, plain"
ONE_THREAD = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL", "NUMBA")}
Array = npt.NDArray[np.float64]
Picture = Callable[[float], Array]
Row = dict[str, Any]


def spots(rng: np.random.Generator, size: int) -> Picture:
    """Bright and dark spots of 1 to 4 pixels, one on 30 pixels."""
    n = (size + 40) ** 2 // 30
    x, y = rng.uniform(-20.0, size + 20.0, (2, n, 1))
    width, height = rng.uniform(1.0, 4.0, (n, 1)), rng.standard_normal((n, 1))
    at = np.arange(size)

    def picture(moved: float) -> Array:
        return (height * np.exp(-0.5 * ((at - y) / width) ** 2)).T @ np.exp(-0.5 * ((at - x - moved) / width) ** 2)

    return picture


def clouds(rng: np.random.Generator, size: int) -> Picture:
    """Structure of all sizes, blurred by a lens of 1 pixel; the field is twice as wide as the picture."""
    down, right = 2.0 * np.pi * np.fft.fftfreq(2 * size)[:, None], 2.0 * np.pi * np.fft.rfftfreq(2 * size)
    k = np.hypot(down, right)
    spectrum = np.fft.rfft2(rng.standard_normal((2 * size, 2 * size))) * np.exp(-0.5 * k**2) / (0.05 + k) ** 1.5

    def picture(moved: float) -> Array:
        return np.fft.irfft2(spectrum * np.exp(-1j * right * moved))[:size, :size]

    return picture


def scratches(rng: np.random.Generator, size: int) -> Picture:
    """Straight grooves in all directions, 1 to 3 pixels wide."""
    rows, columns = np.mgrid[0.0:size, 0.0:size] - size / 2
    lines = rng.uniform([0.0, -size / 2, 1.0, -1.0], [np.pi, size / 2, 3.0, 1.0], (size // 3, 4))

    def picture(moved: float) -> Array:
        x = columns - moved
        return sum(b * np.exp(-0.5 * ((x * np.cos(a) + rows * np.sin(a) - c) / w) ** 2) for a, c, w, b in lines)

    return picture


def rough_edge(rng: np.random.Generator, size: int) -> Picture:
    """The rim of a sample: a wavy edge, 2 pixels wide, dark on one side and without structure on the other."""
    rows, columns = np.mgrid[0.0:size, 0.0:size]
    waves = rng.uniform([0.5, 0.0, 0.05], [4.0, 2.0 * np.pi, 0.5], (6, 3))
    rim = 0.5 * size + sum(a * np.sin(k * rows + phase) for a, phase, k in waves)

    def picture(moved: float) -> Array:
        return np.tanh((columns - moved - rim) / 2.0)

    return picture


PICTURES = {"spots": spots, "clouds": clouds, "scratches": scratches, "rough edge": rough_edge}


def correlated(frames: Array, normalization: str | None) -> Array:
    """What scikit-image gives by itself, to a hundredth of a pixel, under a window that stays where it is."""
    from skimage.registration import phase_cross_correlation

    hann = np.hanning(frames.shape[1])
    seen = (frames - frames.mean(axis=(1, 2), keepdims=True)) * np.outer(hann, hann)
    found = [phase_cross_correlation(seen[0], f, upsample_factor=100, normalization=normalization) for f in seen]
    return np.array([-back[1] for back, _, _ in found])


def errors(kind: str, decibels: int, draws: int, size: int) -> dict[str, Array]:
    """Measured minus true shift by method, shape (draws, n_shifts), and the standard errors."""
    measured: dict[str, list[Array]] = {}
    for draw in range(draws):
        rng = np.random.default_rng([29, list(PICTURES).index(kind), decibels, draw])
        picture = PICTURES[kind](rng, size)
        frames = np.array([picture(shift) for shift in (0.0, *SHIFTS)])
        frames += 10.0 ** (-decibels / 20.0) * frames[0].std() * rng.standard_normal(frames.shape)
        moved = hs.vision.displacement(frames, 1.0, direction="x")
        found = {
            OWN: moved.y,
            WHOLE: hs.vision.displacement(frames, 1.0, direction="x", method="whole-pixel").y,
            PHASE: correlated(frames, "phase"),
            PLAIN: correlated(frames, None),
        }
        for method, shifts in found.items():
            measured.setdefault(method, []).append(shifts[1:] - SHIFTS)
        measured.setdefault("standard errors", []).append(moved.uncertainty[1:])
    return {method: np.array(values) for method, values in measured.items()}


def accuracy(kinds: Iterable[str], draws: int, size: int, decibels: tuple[int, ...]) -> list[Row]:
    """Errors of every method on the kinds of picture under every noise."""
    rows = []
    for kind in kinds:
        for level in decibels:
            found = errors(kind, level, draws, size)
            sure = found.pop("standard errors")
            for method, off in found.items():
                ratio = float(np.sqrt(np.mean((off / sure) ** 2))) if method == OWN else None
                rows.append(
                    {
                        "picture": kind,
                        "snr_db": level,
                        "method": method,
                        "rms_px": float(np.sqrt(np.mean(off**2))),
                        "bias_px": float(np.mean(off)),
                        "largest_bias_px": float(np.abs(off.mean(axis=0)).max()),
                        "error_over_standard_error": ratio,
                    }
                )
    return rows


def stream(n: int, size: int, spent: list[float]) -> Iterator[npt.NDArray[np.uint8]]:
    """Frames of a moving picture with noise; the time that making them takes is added up."""
    begin = time.process_time()
    rng = np.random.default_rng(2901)
    scene = clouds(rng, size)(0.0)
    parts = [clouds(np.random.default_rng(2901), size)(0.25 * k) for k in range(4)]  # of a pixel
    noise = rng.integers(0, 5, (size, 2 * size), dtype=np.uint8)
    for k in range(n):
        moved = 10.0 * (1.0 - math.cos(2.0 * math.pi * k / 80.0))
        whole, part = divmod(round(4.0 * moved), 4)
        frame = np.roll(100.0 + 40.0 * parts[part] / scene.std(), whole, axis=1).clip(0, 250).astype(np.uint8)
        frame += np.roll(noise, int(rng.integers(2 * size)), axis=1)[:, :size]
        spent.append(time.process_time() - begin)
        yield frame
        begin = time.process_time()


def timed(n: int, size: int) -> dict[str, float]:
    """Frames a second of processor time, without that to make them, and the most memory of the process [MiB]."""
    import resource

    hs.vision.displacement(stream(3, size, []), 1.0)
    spent: list[float] = []
    begin = time.process_time()
    moved = hs.vision.displacement(stream(n, size, spent), 1.0)
    seconds = time.process_time() - begin - sum(spent)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    return {"frames": len(moved), "frames_per_second": len(moved) / seconds, "peak_mib": peak}


def alone(n: int, size: int) -> dict[str, float]:
    """The same in a process of its own, on one thread."""
    command = [sys.executable, __file__, str(n), str(size)]
    done = subprocess.run(command, env={**os.environ, **ONE_THREAD}, capture_output=True, text=True, check=True)
    return dict(json.loads(done.stdout))


def main(smoke: bool = False) -> list[Row]:
    """Measure, and unless it is a smoke run write table, figure and JSON."""
    if smoke:
        timed(4, 64)
        return accuracy(("clouds", "rough edge"), 1, 48, (30,))
    rows = accuracy(PICTURES, DRAWS, SIZE, DECIBELS)
    numbers = {"draws": DRAWS, "size": SIZE, "speed_and_memory": [alone(n, 512) for n in (200, 2000)]}
    write_results(RESULTS, rows, draw, numbers)
    for run in numbers["speed_and_memory"]:
        print(f"{run['frames']} frames: {run['frames_per_second']:.0f} a second, at most {run['peak_mib']:.0f} MiB")
    return rows


def draw(rows: list[Row]) -> Figure:
    """The rms error over the noise for each kind of picture."""
    canvas = figure(height=5.0)
    methods = list(dict.fromkeys(row["method"] for row in rows))
    lines = hs.plot.panels(canvas, len(PICTURES), columns=2, sharey=True)
    for ax, kind in zip(lines, PICTURES, strict=True):
        for method, style in zip(methods, ("-o", "--s", "-.^", ":D"), strict=True):
            own = [row for row in rows if (row["picture"], row["method"]) == (kind, method)]
            ax.semilogy([r["snr_db"] for r in own], [r["rms_px"] for r in own], style, markersize=4, label=method)
        ax.plot((30, 20), (0.02, 0.05), "_", color="#333333", markersize=16, label="asked for")
        ax.set(title=kind, xlabel="Picture over noise [dB]", ylabel="rms error [pixel]")
    canvas.legend(*lines[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return canvas


if __name__ == "__main__":
    if len(sys.argv) > 1:
        print(json.dumps(timed(int(sys.argv[1]), int(sys.argv[2]))))
    else:
        for row in main():
            print(
                f"{row['picture']:10} {row['snr_db']} dB  {row['method']:20} {row['rms_px']:.4f} {row['bias_px']:+.4f}"
            )
