"""The table "How good it is" of the README: one row a question, every number read from a stored result.

Each function has the name of a folder of `experiments/results`, takes the content of `result.json` and returns the
question and three cells: hysim, what stands beside it, and where hysim is not good.
"""

from findings import Result, count, driven_alone, error_of, held, number, percent, span, structures, the, where

Cells = tuple[str, str, str, str]


def work_precision(result: Result) -> Cells:
    own, fastest = driven_alone(result)
    lsoda = {
        n: the(result["ratios"], what=f"driven, n = {n}: solve_ivp LSODA, compiled, rtol 1e-06 over hysim")
        for n in ("1", "1.5")
    }
    return (
        "How exact and how fast is a simulation?",
        f"error {error_of(own['error'])} of the range",
        f"fastest package within 1e-3, {fastest['method']}: {number(fastest['times_hysim'], 2)} times as long",
        f"compiled LSODA takes {number(lsoda['1']['median'], 2)} times as long at n = 1, only "
        f"{number(lsoda['1.5']['median'], 2)} times at n = 1.5",
    )


def structures_work_precision(result: Result) -> Cells:
    own = the(result["rows"], problem="three storeys, n = 2", setting="tolerance 1e-08")
    finest = [row for row in result["beside_opensees"] if row["opensees"].endswith("64 substeps")]
    least = min(row["times_faster"] for row in result["beside_opensees"])
    return (
        "And of a frame in an earthquake?",
        f"drifts to {error_of(own['error'])} at the default tolerance",
        f"OpenSees with 64 steps a sample is {span([row['error'] for row in finest], 2)} wrong; hysim is that exact "
        f"{number(min(row['times_faster'] for row in finest), 2)} times faster",
        f"only {number(least, 2)} times faster where a coarse result suffices",
    )


def closed_loop_speed(result: Result) -> Cells:
    own, *peers = where(result["rows"], kind="loop")
    by_name = {row["name"]: row["times_hysim"] for row in peers}
    return (
        "What does a closed loop cost?",
        f"{number(own['microseconds_per_sample'], 2)} us a sample",
        f"python-control: {number(by_name['python-control alone'], 2)} times as long",
        f"your own loop, compiled by numba, is about as fast ({number(by_name['loop compiled by numba'], 2)} times)",
    )


def benchmark_bouc_wen(result: Result) -> Cells:
    known, free = (the(result["summary"], method=f"hysim, n {name}") for name in ("known", "free"))
    black = min(result["published"], key=lambda row: row["multisine"])
    return (
        "How well is the public Bouc-Wen benchmark identified?",
        f"test error {error_of(known['multisine'])} m; the equation is told",
        f"best published black box, which is told nothing: {error_of(black['multisine'])} m",
        f"with the exponent free, all parameters within the target in {count(int(free['parameters_reached']))} of "
        f"{count(int(free['seeds']))} seeds",
    )


def recovery(result: Result) -> Cells:
    return (
        "Do 95 % intervals contain the true parameters?",
        f"in {held(result, 'profile', True)} of noisy records",
        f"linear intervals of least squares: {held(result, 'linear', True)}",
        f"too wide where rounding is the only error: {held(result, 'profile', False)}",
    )


def sindy_recovery(result: Result) -> Cells:
    own, peer, short = structures(result)
    exact, theirs = (sum(rows[name]["exact"] for name in short) for rows in (own, peer))
    (worst,) = (name for name in own if own[name]["exact"] < peer[name]["exact"])
    return (
        "How often is the true equation discovered?",
        f"in {exact} of {result['seeds'] * len(short)} short noisy records",
        f"PySINDy with its defaults: {theirs}",
        f"sampled at {worst}: {own[worst]['exact']} of {result['seeds']}, PySINDy {peer[worst]['exact']}",
    )


def robustness(result: Result) -> Cells:
    best, pid = the(result["rows"], controller="robust, EI", exponent="held"), the(result["rows"], controller="PID")
    return (
        f"How much hysteresis does a controller remove if its model is up to {result['spread_percent']:g} % wrong?",
        f"{percent(best['hysteresis_reduction_percent_p5'])} or more in 95 % of draws",
        f"PID: {percent(pid['hysteresis_reduction_percent_p5'])}",
        f"of the vibration after an unannounced step {percent(best['residual_rms_reduction_percent_p5'])}",
    )


HEADLINES = (
    work_precision,
    structures_work_precision,
    closed_loop_speed,
    benchmark_bouc_wen,
    recovery,
    sindy_recovery,
    robustness,
)
