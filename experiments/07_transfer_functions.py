"""How near does the identification of a stiff plant come to what the noise allows?

The plant of Rao and Garnier, (-6400 s + 1600) / (s^4 + 5 s^3 + 408 s^2 + 416 s + 1600), has a slow mode, one ten times
as fast, and a zero on the wrong side. It is driven by a binary input held for 0.2 s, 4000 samples at 100 Hz, and white
noise is drawn anew for each identification. The fit is to the output without noise. Six parameters at the bound
of Cramer and Rao leave chi-squared of 6 degrees times the noise's variance in the sum of squares:

    fit = 100 (1 - sqrt(chi2_6 / (N SNR)))    with the ratio SNR of the variances of output and noise
"""

import math
import sys
from pathlib import Path

import numpy as np
from scipy.stats import chi2

import hysim as hs
from hysim.plot import Figure, figure

sys.path.insert(0, str(Path(__file__).parent))
from results_folder import wall_timed, write_files

RESULTS = Path(__file__).parent / "results" / "transfer_functions"
TRUE = hs.TransferFunction(num=(-6400.0, 1600.0), den=(1.0, 5.0, 408.0, 416.0, 1600.0))
STRUCTURE = hs.TransferFunction.structure(poles=4, zeros=1)
SAMPLE_TIME, HELD = 0.01, 20  # s, samples
BLOCK = 20  # draws of which a median is asked
ASKED = {math.inf: 99.9, 10.0: 98.7, 1.0: 96.3}  # percent, by the ratio of variances
Row = dict[str, float | None]


def main(smoke: bool = False) -> list[Row]:
    """Identify from every draw, and unless it is a smoke run write table, figure and JSON."""
    n, draws = (1000, 2) if smoke else (4000, 200)
    u = np.repeat(np.random.default_rng(0).choice([-1.0, 1.0], n // HELD), HELD)
    clean = TRUE.response(u, SAMPLE_TIME)
    fits: dict[float, np.ndarray] = {}
    rows = []
    for snr in list(ASKED)[: 2 if smoke else None]:
        fits[snr], row = study(u, clean, snr, 1 if math.isinf(snr) else draws)
        rows.append(row)
    if not smoke:
        plain = {f"{snr:g}": np.round(each, 4).tolist() for snr, each in fits.items()}
        write_files(RESULTS, rows, lambda _: draw(fits), {"fits": plain})
    return rows


def study(u: np.ndarray, clean: np.ndarray, snr: float, draws: int) -> tuple[np.ndarray, Row]:
    """The fits of all draws at one level of noise [percent], and their line of the table."""
    t, sigma = SAMPLE_TIME * np.arange(u.size), np.sqrt(np.var(clean) / snr)
    fits, seconds, found, stderr = [], [], [], []
    for seed in range(draws):
        y = clean + sigma * np.random.default_rng(seed).standard_normal(u.size)
        record = hs.Record(u=u, y=y, t=t)
        fit, lasted = wall_timed(hs.identify, STRUCTURE, record)
        seconds.append(lasted)
        fits.append(hs.metrics.fit_percent(clean, fit.model.response(u, SAMPLE_TIME)))
        found.append([fit.estimates[name] for name in fit.free_names])
        stderr.append([fit.stderr[name] for name in fit.free_names])
    medians = block_medians(np.array(fits))
    ratios = np.std(found, axis=0) / np.sqrt(np.mean(np.square(stderr), axis=0)) if draws > 1 else np.full(1, np.nan)
    values = {
        "snr": snr,
        "draws": draws,
        "asked_fit": ASKED[snr],
        "median_fit": float(np.median(fits)),
        "lowest_median_of_20": float(medians.min()),
        "highest_median_of_20": float(medians.max()),
        "blocks_as_asked": int(np.sum(medians >= ASKED[snr])),
        "blocks": medians.size,
        "bound_median_fit": float(bound(chi2.ppf(0.5, 6), u.size, snr)),
        "lowest_spread_over_stderr": float(ratios.min()),
        "highest_spread_over_stderr": float(ratios.max()),
        "median_seconds": float(np.median(seconds)),
    }
    return np.array(fits), {name: value if math.isfinite(value) else None for name, value in values.items()}


def block_medians(fits: np.ndarray) -> np.ndarray:
    """The median of each block of 20 draws; of fewer draws, of all."""
    return np.median(fits.reshape(-1, BLOCK) if fits.size % BLOCK == 0 else fits[np.newaxis], axis=1)


def bound(chi_squared: float | np.ndarray, n: int, snr: float) -> float | np.ndarray:
    """The fit [percent] that so large an error leaves."""
    return 100.0 * (1.0 - np.sqrt(chi_squared / (n * snr)))


def draw(fits: dict[float, np.ndarray]) -> Figure:
    """For each level of noise the share of draws below a fit, the bound's, and the medians of 20 draws."""
    canvas = figure(height=3.4)
    noisy = [snr for snr in fits if math.isfinite(snr)]
    for ax, snr in zip(canvas.subplots(1, len(noisy), sharey=True), noisy, strict=True):
        found = np.sort(fits[snr])
        share = (np.arange(found.size) + 0.5) / found.size
        medians = block_medians(fits[snr])
        ax.plot(found, share, color="#0072B2", label="200 draws")
        allowed = bound(chi2.ppf(1.0 - share, 6), 4000, snr)
        ax.plot(allowed, share, color="#D55E00", linestyle=(0, (4, 1.5)), label="bound")
        ax.plot(medians, np.full(medians.size, 0.5), "o", color="#222222", markersize=3.5, label="medians of 20")
        ax.axvline(ASKED[snr], color="#777777", linestyle=":", label="asked median")
        ax.set(title=f"SNR {snr:g}", xlabel="Fit to the clean output [%]", ylim=(0.0, 1.0))
    canvas.axes[0].set_ylabel("Share of draws below")
    canvas.legend(*canvas.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return canvas


if __name__ == "__main__":
    for line in main():
        noise = "no noise" if line["snr"] is None else f"SNR {line['snr']:g}"
        print(
            f"{noise:8}  median {line['median_fit']:.2f} % (asked {line['asked_fit']:.1f}, bound "
            f"{line['bound_median_fit']:.2f}), of 20 draws {line['lowest_median_of_20']:.2f} to "
            f"{line['highest_median_of_20']:.2f}, {line['median_seconds']:.2f} s each"
        )
