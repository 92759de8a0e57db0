"""What does sparse regression find in the 52 points of Table 1, and how much of it do the points really show?

The discovered law and Bouc-Wen laws are judged by the same numbers: fit in free run, BIC, loop width; and each with its
memory free at the first point and at rest there. Twenty records are then drawn anew from the law, with normal noise of
its residual and the camera's rounding, to see which of its terms `discover` finds again with the library of u and y.
Errors at points that the whole search has not seen are experiment 33's.
"""

import sys
from pathlib import Path

import numpy as np

import hysim as hs
from hysim.plot import Figure, loop

sys.path.insert(0, str(Path(__file__).parent))
from results_folder import cpu_timed, one_panel, write_results

RESULTS = Path(__file__).parent / "results" / "sindy_table1"
MEASURED_WIDTH = 0.232  # um, of Table 1
REPEATS = 3
DRAWS = 20  # records drawn anew, to see whether the structure is found again

Row = dict[str, float | str | None]


def discovered(record: hs.Record) -> tuple[hs.Discovery, float]:
    """The law, and the processor seconds of a warm call."""
    found = hs.discover(record)
    return found, float(np.median([cpu_timed(hs.discover, record)[1] for _ in range(REPEATS)]))


def row_of(name: str, result: hs.Discovery | hs.Identification, record: hs.Record, seconds: float | None) -> Row:
    """One line of the table."""
    y = result.model.response(record.u)
    width = hs.loop_metrics(record.u, y)
    scores = result.scores if isinstance(result, hs.Discovery) else vars(result)
    return {
        "model": name,
        "n_parameters": result.n_parameters,
        "fit_percent": float(scores["fit_percent"]),
        "bic": float(scores["bic"]),
        "max_width_um": width.max_width,
        "max_width_at_V": width.max_width_at,
        "width_error_percent": 100.0 * (width.max_width / MEASURED_WIDTH - 1.0),
        "cpu_seconds": seconds,
    }


def found_again(law: hs.Discovery, record: hs.Record, draws: int) -> dict[str, float]:
    """Share of records drawn from the law, rounded as the camera does, in which each term is found again."""
    rng = np.random.default_rng(0)
    y, quantum = law.model.response(record.u), float(record.resolution or 0.0)
    counts: dict[str, int] = {}
    for _ in range(draws):
        noisy = y + law.scores["rmse"] * rng.standard_normal(y.size)
        again = hs.discover(hs.Record(u=record.u, y=quantum * np.round(noisy / quantum)), library="duhem")
        for term in again.coefficients:
            counts[term] = counts.get(term, 0) + 1
    return {term: count / draws for term, count in sorted(counts.items())}


def main(smoke: bool = False) -> list[Row]:
    """Measure, print and write table, figure and result."""
    record = hs.datasets.table1(dwell=1.0)
    if smoke:
        return [row_of("discovered", hs.discover(record, library="duhem", degree=1), record, None)]
    found, seconds = discovered(record)
    families = {"bouc-wen": hs.BoucWen, "polynomial bouc-wen": hs.PolynomialBoucWen, "zhu-wang": hs.ZhuWangBoucWen}
    rows = [row_of("discovered", found, record, seconds)]
    for start in ("free", "rest"):
        rows.append(row_of(f"discovered, {start}", hs.discover(record, initial=start), record, None))
        rows += [
            row_of(f"{name}, {start}", hs.identify(family, record, initial=start), record, None)
            for name, family in families.items()
        ]
    shares = found_again(found, record, DRAWS)
    print(found.summary())
    for row in rows:
        print(
            f"{row['model']:<25} {row['n_parameters']} parameters, fit {row['fit_percent']:.2f} %, BIC "
            f"{row['bic']:.1f}, width {row['max_width_um']:.4f} um at {row['max_width_at_V']:g} V "
            f"({row['width_error_percent']:+.1f} %)"
        )
    print(f"discover: {seconds:.1f} s of the processor, warm")
    print("terms found again: " + ", ".join(f"{term} {100.0 * share:.0f} %" for term, share in shares.items()))
    numbers = {
        "verdict": found.verdict,
        "equation": found.equation,
        "terms": list(found.coefficients),
        "draws": DRAWS,
        "found_again": shares,
        "cpu_seconds": seconds,
    }
    return write_results(RESULTS, rows, lambda _: draw(found, record), numbers)


def draw(found: hs.Discovery, record: hs.Record) -> Figure:
    """The measured loop and the discovered one."""
    canvas, axes = one_panel(3.0)
    loop(record, hs.simulate(found.model, record.t, record.u), ax=axes)
    return canvas


if __name__ == "__main__":
    main()
