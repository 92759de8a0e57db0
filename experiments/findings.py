"""What each experiment found, in at most three paragraphs and tables that are computed from its stored result.

Each function in `GROUPS` has the name of a folder of `experiments/results`. It takes the content of `result.json` and
returns paragraphs, of which the first answers the question, and tables. A sentence has at most three numbers: series
and ranges stand in tables. No number stands in a sentence that is not read from the result. A claim that rests on a
comparison is made by `require`, which raises `ValueError` where the result no longer supports it, so that a sentence
cannot outlive its numbers. Each finding says the worst case and the median or the best, compares hysim with the best
peer, and says what a method was told that a user would not know.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from statistics import mean, median
from typing import Any

Result = Mapping[str, Any]
Row = Mapping[str, Any]
Finding = Callable[[Result], list[str]]


# Reading a result ----------------------------------------------------------------------------------------------------


def where(rows: Iterable[Row], **values: object) -> list[Row]:
    """The rows that have all of these values; `ValueError` if there is none."""
    matching = [row for row in rows if all(row[name] == value for name, value in values.items())]
    if not matching:
        raise ValueError(f"no row has {values}")
    return matching


def the(rows: Iterable[Row], **values: object) -> Row:
    """The one row that has all of these values; `ValueError` if there are none or several."""
    (row,) = where(rows, **values)
    return row


def column(rows: Iterable[Row], name: str) -> list[float]:
    """One column, without empty cells."""
    return [row[name] for row in rows if row.get(name) is not None]


def require(condition: bool, claim: str) -> None:
    """Raise `ValueError` where a result no longer supports a claim that its sentence makes."""
    if not condition:
        raise ValueError(f"the result no longer supports: {claim}")


# Writing numbers -----------------------------------------------------------------------------------------------------


def number(value: float, digits: int = 3) -> str:
    """A number to some significant digits, without an exponent between 0.001 and a million."""
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    if value != 0.0 and not -3 <= int(exponent) < 6:
        return f"{mantissa}e{int(exponent)}"
    whole, _, decimals = f"{float(f'{mantissa}e{exponent}'):_.{max(0, digits - 1 - int(exponent))}f}".partition(".")
    return whole.replace("_", " ") + (f".{decimals}" if decimals.strip("0") else "")


def span(values: Iterable[float], digits: int = 3, unit: str = "") -> str:
    """The least and the largest of some numbers, or the one that both are."""
    collected = list(values)
    ends = dict.fromkeys((number(min(collected), digits), number(max(collected), digits)))
    return " to ".join(ends) + unit


def count(value: int) -> str:
    """A whole number with a space between thousands."""
    return f"{value:_}".replace("_", " ")


def percent(value: float, decimals: int = 1) -> str:
    """A percentage to a fixed number of decimals."""
    return f"{value:.{decimals}f} %"


def error_of(value: float) -> str:
    """An error to two significant digits."""
    return number(value, 2)


def nanometres(value: float) -> str:
    """A length in micrometres as a number of nanometres."""
    return f"{1e3 * value:.1f}"


def at_rounding(value: float) -> str:
    """An error that is one of rounding; `ValueError` if it is not."""
    require(value < 1e-14, f"an error of {value:g} is one of rounding")
    return error_of(value)


def listed(parts: Sequence[str]) -> str:
    """Words joined by commas and an "and"."""
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"


def tabled(*rows: Sequence[str]) -> str:
    """A table of Markdown; the first row names the columns."""
    head, *others = (f"| {' | '.join(row)} |" for row in rows)
    return "\n".join(["", head, "|---" * len(rows[0]) + "|", *others, ""])


def by_row(rows: Iterable[Row], *columns: tuple[str, str, Callable[[Any], str]]) -> str:
    """A table of Markdown with a line for each row; a column is its head, the name of its values, and their format."""
    heads, names, formats = zip(*columns, strict=True)
    return tabled(heads, *([each(row[name]) for name, each in zip(names, formats, strict=True)] for row in rows))


def crossed(
    title: str, rows: Iterable[Row], line: str, across: str, value: str, write: Callable[[Any], str] = percent
) -> str:
    """A table of Markdown with a line for each value of the column `line`, and a column for each one of `across`."""
    lines, heads = (dict.fromkeys(row[name] for row in rows) for name in (line, across))
    cells = {name: [write(the(rows, **{line: name, across: head})[value]) for head in heads] for name in lines}
    return tabled([title, *map(_head, heads)], *([_head(name), *each] for name, each in cells.items()))


def _head(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:g}"


# Evaluation and speed ------------------------------------------------------------------------------------------------


def exact_step(result: Result) -> list[str]:
    """Errors and times of the exact step, compared with integrators in Python."""
    rows, near = result["rows"], result["lsoda_from_near_starts"]
    own, methods = where(rows, method="hysim"), dict.fromkeys(row["method"] for row in rows)
    require(min(column(rows, "time_ratio")) == 1.0, "no integrator is faster")
    require(max(column(own, "error")) < min(row["error"] for row in rows if row not in own), "none is more exact")
    columns = ("time_ratio", 3), ("error", 2)
    cells = [[m, *(span(column(where(rows, method=m), key), digits) for key, digits in columns)] for m in methods]
    exponents = listed([format(n, "g") for n in column(own, "n")])
    return [
        f"The law is exact to rounding: its error is at most {at_rounding(max(column(own, 'error')))} of the memory's "
        "range. No integrator in Python is faster or more exact.",
        tabled((f"{count(result['samples'])} samples, n = {exponents}", "time, hysim = 1", "error"), *cells),
        f"LSODA's error is not reproducible: from {near[0]['starts']} almost equal starts it is "
        f"{error_of(min(column(near, 'least')))} to {error_of(max(column(near, 'most')))}. These integrators call a "
        "right-hand side in Python; experiment 03 compares compiled ones.",
    ]


def work_precision(result: Result) -> list[str]:
    """Time against error, compared with other packages and C, driven and as an oscillator."""
    own, fastest = driven_alone(result)
    in_c = the(result["rows"], problem="driven, n = 1", method="exact step in C")
    oscillator = [row for row in where(result["rows"], problem="oscillator") if row["error"] <= 1e-6]
    others = [row for row in oscillator if not row["method"].startswith("hysim") and row["method"] != "split in C"]
    packages = fastest, min(others, key=lambda row: float(row["times_hysim"]))
    scheme = the(result["ratios"], what="oscillator: hysim over the same scheme in C")
    missed = [row for row in result["ratios"] if row.get("reached") is False]
    require(all("at_least" in row for row in missed), "hysim is fast enough compared with C and np.exp")
    return [
        f"At n = 1 the law is exact to rounding: its error is {at_rounding(own['error'])} of the range. The fastest "
        f"package with an error of at most 1e-3 takes {number(fastest['times_hysim'])} times as long.",
        tabled(
            ("time, hysim = 1", "driven law, errors up to 1e-3", "oscillator, errors up to 1e-6"),
            ("fastest package", *(f"{number(row['times_hysim'])} ({row['method']})" for row in packages)),
            ("hysim's own scheme in C", number(in_c["times_hysim"]), number(1.0 / scheme["median"])),
        ),
        by_row(
            missed,
            ("ratio of times that was not reached", "what", str),
            ("asked", "at_least", number),
            ("measured", "median", number),
        ),
    ]


def driven_alone(result: Result) -> tuple[Row, Row]:
    """The law driven with n = 1, by hysim and by the fastest package whose error is at most 1e-3."""
    driven = where(result["rows"], problem="driven, n = 1")
    packages = [row for row in driven if row["tool"] not in ("hysim", "C", "C, Runge-Kutta 4") and row["error"] <= 1e-3]
    return the(driven, method="hysim memory"), min(packages, key=lambda row: float(row["times_hysim"]))


def batch(result: Result) -> list[str]:
    """Samples a second of many laws."""
    rows, slopes = where(result["rows"], kind="rows"), result["slopes"].values()
    require(max(slopes) < 1.05, "the cost grows at most in proportion")
    speed = "million_samples_per_second"
    plays = {name: [1e3 / row[speed] for row in where(result["rows"], kind=name)] for name in ("path", "steps")}
    fit = result["long_fit"]
    return [
        f"A batch takes {span(column(rows, 'times_exp'), 2)} times as long as `np.exp` on as many numbers. The "
        f"cost grows at most in proportion to samples and laws (powers of {span(slopes, 2)}). The speeds are those "
        f"of {count(rows[0]['sets'])} laws with {rows[0]['samples']} samples each, on all cores.",
        by_row(rows, ("law", "law", str), ("million samples a second", speed, number)),
        f"One sum of up to 1024 plays takes {span(plays['path'], 2)} ns a sample, on inputs from a sine to noise. A "
        f"loop of its step, in which each sample clamps all plays, takes {span(plays['steps'], 2)} ns.",
        f"Identifying a law on {count(fit['samples'])} noisy samples takes {number(fit['cpu_seconds'], 2)} CPU seconds."
        f" The process, of {number(fit['before'], 3)} MB with the record, grows to {number(fit['at_most'], 3)} MB.",
    ]


def cold_start(result: Result) -> list[str]:
    """The first call, compiled, from a wheel and from the cache."""
    rows = result["rows"]
    kinds = {name: column(rows, name) for name in ("compiled", "from a wheel", "from the cache")}
    seconds = [(name, number(median(each), 2), number(max(each), 2)) for name, each in kinds.items()]
    return [
        f"From a wheel the first call takes {seconds[1][1]} s of processor time in the median, and {seconds[0][1]} s "
        "where it has to be compiled.",
        tabled((f"first of {len(rows)} calls [s of processor time]", "median", "worst"), *seconds),
    ]


def more_samples(result: Result) -> list[str]:
    """The invariant that more samples on a branch change nothing."""
    rows, ends = result["rows"], ("escaped", "undecided", "refused", "partly_refused")

    def left_out(row: Row) -> float:
        return float(100.0 * sum(row[end] for end in ends) / row["cases"])

    worst, families = max(rows, key=left_out), {row["family"] for row in rows}
    return [
        f"{result['violations']} of {count(result['cases'])} comparisons violate the invariant; the largest difference "
        f"is {number(max(column(rows, 'worst')), 2)} of what is allowed. Each of {len(families)} families has "
        f"{count(result['cases_per_family'])} random hostile cases, in paths, batches, compiled steps and inverses.",
        f"At worst, for `{worst['family']}`, {percent(left_out(worst))} of the cases are compared in part only or not "
        "at all, because the law diverges in all samplings or a step is refused.",
    ]


def wear_and_pinching(result: Result) -> list[str]:
    """Backward Euler compared with the integrated law."""
    rows = where(result["rows"], law="worn and pinched")
    errors = column(rows, "backward_euler_percent")
    return [
        f"Backward Euler, which OpenSees uses, is {span(errors, 2)} % wrong on a spring that wears off and pinches.",
        by_row(rows, ("steps a cycle", "steps", str), ("error [%]", "backward_euler_percent", error_of)),
        "Its step is programmed anew here, not run in OpenSees. With half the steps hysim's law changes by at most "
        f"{error_of(max(column(result['rows'], 'law_percent')))} % of the memory's range.",
    ]


# Identification ------------------------------------------------------------------------------------------------------


def benchmark_bouc_wen(result: Result) -> list[str]:
    """The public benchmark, told and not told how it was made."""
    black, told = min(result["published"], key=lambda row: row["multisine"]), result["summary"][0]
    errors, name = result["white_box"]["error_percent"], result["white_box"]["method"]
    worst = max(errors, key=errors.__getitem__)
    return [
        "Told the true equation, its exponent n and how the records were made, hysim has test errors of at most "
        f"{error_of(max(told['multisine'], told['sweep']))} m. The best published black box, which is not told these, "
        f"has an error of {error_of(black['multisine'])} m ({black['method']}).",
        by_row(
            result["summary"],
            (f"largest over {told['seeds']:.0f} seeds", "method", str),
            ("test error, multisine [m]", "multisine", error_of),
            ("sweep [m]", "sweep", error_of),
            ("seeds whose tests reach the target", "tests_reached", "{:.0f}".format),
            ("seeds whose parameters all reach it", "parameters_reached", "{:.0f}".format),
            ("share expected by chance", "chance", "{:.2f}".format),
        ),
        f"A published fit of the same equation ({name}) is {number(errors[worst])} % off in {worst}, hysim with n "
        f"known {number(told[f'{worst}_error_percent'], 2)} %.",
    ]


def transfer_functions(result: Result) -> list[str]:
    """A stiff plant and the bound of Cramer and Rao."""
    noisy = [row for row in result["rows"] if row["snr"] is not None]
    gaps = [abs(row["median_fit"] - row["bound_median_fit"]) for row in noisy]
    for row, gap in zip(noisy, gaps, strict=True):
        require(gap < 0.25 * (100.0 - row["bound_median_fit"]), "the median fit is near the bound")
    fit = "{:.2f} %".format
    return [
        "The median fit to the clean output differs from what the bound of Cramer and Rao allows by at most "
        f"{number(max(gaps), 1)} percentage points.",
        by_row(
            [{**row, "worst": min(result["fits"][f"{row['snr']:g}"])} for row in noisy],
            ("SNR", "snr", "{:g}".format),
            ("median fit", "median_fit", fit),
            ("bound", "bound_median_fit", fit),
            ("fit asked for", "asked_fit", percent),
            (f"worst of {noisy[0]['draws']} draws", "worst", fit),
        ),
        "The numbers of poles and zeros are told.",
    ]


def table1_models(result: Result) -> list[str]:
    """Which model the 52 points prefer."""
    rows = result["rows"]
    best = the(rows, model=result["preferred"])
    least = min((row for row in rows if row["loo_rmse"] is not None), key=lambda row: row["loo_rmse"])
    require(best["bic"] == min(column(rows, "bic")), "the preferred model has the lowest BIC")
    return [
        f"By BIC the points prefer the model {best['model']}. Its largest residual is "
        f"{best['largest_residual_pixels']:.2f} pixels. The second model below has the least leave-one-out rmse.",
        by_row(
            (best, least, the(rows, model="bouc-wen"), the(rows, model="line")),
            ("model", "model", str),
            ("parameters", "parameters", str),
            ("fit", "fit_percent", "{:.2f} %".format),
            ("leave-one-out rmse [nm]", "loo_rmse", nanometres),
        ),
        f"The choice is not sure: {len(result['close']) - 1} other variants of {len(rows)} have a BIC within 6 of the "
        "lowest. All were tried on the same points; experiment 33 repeats the search without the point that it "
        "predicts.",
    ]


def held(result: Result, kind: str, noisy: bool) -> str:
    """How many of 400 records hold the truth in their intervals of a kind, with noise or with rounding alone."""
    rows = [row for row in where(result["rows"], records=400, kind=kind) if (row["noise_in_quanta"] > 0.0) == noisy]
    return span(column(rows, "coverage_percent"), 3, " %")


def recovery(result: Result) -> list[str]:
    """Coverage of 95 % intervals."""
    rows = where(result["rows"], records=400)
    levels = listed([f"{level:g}" for level in sorted({row["noise_in_quanta"] for row in rows} - {0.0})])
    missing = min(rows, key=lambda row: row["with_interval"])
    kinds = {"profile": "profile", "linear": "linear, of least squares"}
    return [
        f"With noise, the profile intervals of a parameter hold the truth in {held(result, 'profile', True)} of 400 "
        "records. With rounding alone they are too wide.",
        tabled(
            ("95 % intervals that hold the truth, by parameter", f"noise of {levels} quanta", "rounding alone"),
            *((name, held(result, kind, True), held(result, kind, False)) for kind, name in kinds.items()),
        ),
        f"At worst {missing['records'] - missing['with_interval']} of {missing['records']} records have no interval, "
        f"with noise of {missing['noise_in_quanta']:g} quanta. Family, quantum and input are told; the noise is not.",
    ]


def all_families(result: Result) -> list[str]:
    """Every family on the 52 points."""
    rows = result["rows"]
    best = the(rows, model=result["winner"])
    undecided = [the(rows, model=name) for name in result["undecided"]]
    last = max(undecided, key=lambda row: row["loo_rmse"])
    return [
        f"{result['winner']} with {best['parameters']} parameters predicts left-out points best, to "
        f"{nanometres(best['loo_rmse'])} nm; BIC prefers {result['preferred_by_bic']}.",
        f"So few points decide little: by signed ranks {len(undecided)} of the {len(rows) - 1} others cannot be "
        f"distinguished from it, even {last['model']} with {nanometres(last['loo_rmse'])} nm. Each family has one form "
        "here; experiment 08 varies that of the Bouc-Wen laws.",
    ]


_NESTED = (("Bouc-Wen", "free"), ("linear plant, 4 poles", "rest"), ("line", ""))


def nested_table1(result: Result) -> list[str]:
    """Left-out errors with the whole search repeated."""
    rows = [row for row in result["rows"] if not row["terms_kept"]]
    discovered = the(rows, model="discovered", start="auto")
    best = min(rows, key=lambda row: row["left_out_rmse_um"])
    near = [row for row in rows if row["behind_in_stderr"] < 1.0]
    families = listed(list(dict.fromkeys(row["model"].split(",")[0] for row in near)))
    return [
        f"{best['model']} (start: {best['start']}) predicts best the points that are left out one at a time. The "
        f"discovered law has the same terms in {discovered['same_structure']} of {discovered['folds']} searches.",
        by_row(
            (best, discovered, *(the(rows, model=name, start=start) for name, start in _NESTED)),
            ("model", "model", str),
            ("rmse at left-out points [nm]", "left_out_rmse_um", nanometres),
            ("largest error [nm]", "largest_left_out_um", nanometres),
        ),
        f"{len(near)} of {len(rows)} rows ({families}) lie within one standard error of the least error: the points do "
        "not decide which of these predicts better.",
    ]


def simulated_twins(result: Result) -> list[str]:
    """Default calls of `identify` against the truth and SciPy."""
    devices = result["devices"]
    slowest = max(devices, key=lambda name: devices[name]["worst_seconds"])
    hardest = min(devices, key=lambda name: devices[name]["reached_percent"])
    return [
        f"In {percent(result['reached_percent'])} of {count(result['cases'])} records the default call of `identify` "
        "reaches the best sum of squares known to 1 %. `scipy.optimize.least_squares` from up to 20 random starts, in "
        "ten times the time and on the same compiled laws, is better by more than that in "
        f"{percent(result['beaten_by_scipy_percent'])}.",
        f"Of {len(devices)} kinds of device, it reaches the fewest optima for {hardest}: "
        f"{percent(devices[hardest]['reached_percent'], 0)}. At worst the sum of squares is "
        f"{number(result['worst_over_best_known'])} times the best known.",
        f"A call takes {result['median_seconds']:.2f} s in the median and {result['worst_seconds']:.0f} s at worst "
        f"({slowest}).",
    ]


def measured_records(result: Result) -> list[str]:
    """Default calls of `identify` on measured records against SciPy and other seeds."""
    slowest = max(result["rows"], key=lambda row: float(row["seconds"]))
    return [
        f"In {percent(result['reached_percent'])} of {count(result['cases'])} cases, each a measured record and a "
        "family that suits it, the default call of `identify` reaches the best sum of squares known to 1 %. "
        "`scipy.optimize.least_squares` from up to 20 random starts, in ten times the time and on the same compiled "
        f"laws, is better by more than that in {percent(result['beaten_by_scipy_percent'])}. Its time was limited to "
        f"{number(result['longest_scipy_seconds'])} s, which ended it in {percent(result['shortened_scipy_percent'])} "
        f"of the cases. The {count(result['records'])} records are public.",
        by_row(
            result["lost"],
            ("record where a better fit is known", "record", str),
            ("family", "family", str),
            ("sum of squares, best known = 1", "over_best_known", number),
        ),
        f"A call takes {result['median_seconds']:.2f} s of processor time in the median and "
        f"{result['worst_seconds']:.0f} s at worst ({slowest['family']} on {slowest['record']}). In "
        f"{count(result['not_converged'])} calls the search did not converge, and the call said so.",
    ]


def choice(result: Result) -> list[str]:
    """The family that is chosen for a record, against every one."""
    simulated, measured, rows = result["simulated"], result["measured"], result["rows"]
    require(not simulated["diverged"] + measured["diverged"], "no chosen law diverges on its own record")
    kinds = {kind: where(rows, kind=kind) for kind in dict.fromkeys(row["kind"] for row in rows)}
    cells = [
        (
            kind,
            str(len(own)),
            *(error_of(100.0 * median(column(own, name))) for name in ("error", "best_error")),
            number(max(column(own, "ratio"))),
        )
        for kind, own in kinds.items()
    ]

    def near(part: Result, what: str) -> str:
        shares = [percent(100.0 * part[f"within_{most}"], 0) for most in ("1.1", "1.3", "2")]
        return (
            f"The chosen family's error is at most 1.1 times the best one's for {shares[0]} of {part['records']} "
            f"{what}. It is at most 1.3 times for {shares[1]}, and at most twice for {shares[2]}."
        )

    return [
        f"{near(simulated, 'simulated devices')} {near(measured, 'measured records')}",
        "Which family is the best is known afterwards only. No chosen law diverges. A choice takes "
        f"{number(simulated['median_seconds'], 2)} CPU seconds in the median and "
        f"{number(max(part['longest_seconds'] for part in (simulated, measured)), 2)} at most.",
        tabled(("kind", "records", "median error in %", "of the best family", "largest ratio"), *cells),
    ]


def identified_frame(result: Result) -> list[str]:
    """A frame identified from two earthquakes, and its drifts in a third."""
    require(result["converged"] == result["seeds"], "every search converges")
    require(result["median_peak_drift_error_percent"] < 2.0, "peak drifts within 2 % in the median")
    ends, of_laws = ("median", "worst"), f"error of the laws' numbers (worst: `{result['worst_law_parameter']}`)"
    kinds = {"error of the largest drifts": "peak_drift", "error of the damping": "damping", of_laws: "law"}
    cells = [
        [name, *(f"{error_of(result[f'{end}_{key}_error_percent'])} %" for end in ends)] for name, key in kinds.items()
    ]
    correlations = [f"{result[f'{end}_correlation_of_damping']:.2f}" for end in ends]
    return [
        "The largest drifts of the third earthquake are predicted to "
        f"{error_of(result['median_peak_drift_error_percent'])} % in the median and "
        f"{error_of(result['worst_peak_drift_error_percent'])} % at worst. The accelerations have noise of 2 % of "
        f"their peak; the search starts 50 % off in each of {len(result['parameters'])} numbers.",
        tabled(
            (f"{count(result['seeds'])} seeds, three storeys", *ends),
            *cells,
            ("largest correlation of the damping with a law's number", *correlations),
            ("search on two cores", *(f"{number(result[f'{end}_seconds'], 2)} s" for end in ends)),
        ),
        f"Damping and yielding can be distinguished, and the errors are {result['rms_error_in_stderr']:.2f} standard "
        "errors in the rms. The masses, the form of the law and the motion of the ground are told.",
    ]


# Discovery -----------------------------------------------------------------------------------------------------------


def structures(result: Result) -> tuple[dict[str, Row], dict[str, Row], list[str]]:
    """How often hysim and PySINDy find the true structure, by condition, and the conditions of short noisy records."""
    own, peer = (
        {row["condition"]: row for row in where(result["rows"], method=method)} for method in ("hysim", "PySINDy")
    )
    return own, peer, [name for name in own if ", noise" in name and not name.endswith("noise 0%")]


def sindy_recovery(result: Result) -> list[str]:
    """How often the true structure is found, by hysim and by PySINDy."""
    (own, peer, short), seeds = structures(result), result["seeds"]
    exact, theirs = (sum(rows[name]["exact"] for name in short) for rows in (own, peer))
    unlikely = sum(seeds - own[name]["as_likely"] for name in short)
    conditions = {"noise 10%": "memory measured, 10 % noise", "y = 40 u + 60 z": "memory hidden in y = 40 u + 60 z"}
    conditions |= {name: f"PySINDy ahead: {name}" for name in own if own[name]["exact"] < peer[name]["exact"]}
    worst = max((row for row in own.values() if row["worst_error_percent"]), key=lambda row: row["worst_error_percent"])
    return [
        f"On short records of two rates with noise the structure is exact in {exact} of {seeds * len(short)} (PySINDy: "
        f"{theirs}). In {unlikely} of the {seeds * len(short) - exact} misses the data themselves prefer the wrong "
        "law.",
        tabled(
            (f"exact structures in {seeds} seeds", "hysim", "PySINDy"),
            *((said, str(own[name]["exact"]), str(peer[name]["exact"])) for name, said in conditions.items()),
        ),
        f"The worst coefficient is {number(worst['worst_error_percent'], 2)} % off ({worst['condition']}). The library "
        "of ten terms contains the true ones. PySINDy runs with its defaults, and is told the true velocity.",
    ]


def sindy_table1(result: Result) -> list[str]:
    """Sparse regression on the 52 points."""
    own, rows = the(result["rows"], model="discovered"), result["rows"]
    laws = [row for row in rows if not row["model"].startswith("discovered")]
    fit, bic = max(laws, key=lambda row: row["fit_percent"]), min(laws, key=lambda row: row["bic"])
    *often, seldom = sorted((result["found_again"][term] for term in result["terms"]), reverse=True)
    require(own["bic"] < bic["bic"], "the discovered law has the lowest BIC")
    return [
        f"A law of {len(result['terms'])} terms has a lower BIC than every Bouc-Wen law. The table has the best of "
        "these by fit and BIC.",
        by_row(
            [own, *(row for row in laws if row in (fit, bic))],
            ("law", "model", str),
            ("parameters", "n_parameters", str),
            ("fit", "fit_percent", "{:.2f} %".format),
            ("BIC", "bic", "{:.1f}".format),
        ),
        f"In {count(result['draws'])} records drawn anew from the law, {len(often)} of its terms are found again in at "
        f"least {100 * min(often):.0f} %. The last term is found again in {100 * seldom:.0f} %. The verdict is "
        f'"{result["verdict"]}".',
    ]


def sindy_benchmark(result: Result) -> list[str]:
    """The benchmark's law from input and output alone."""
    rows, library = result["rows"], the(result["rows"], case="benchmark", seed=1)["library"]

    def said(name: str, case: str) -> list[str]:
        cells = where(rows, case=case)
        require(all(row["right_terms"] for row in cells), "the right terms are found")
        errors = error_of(max(*column(cells, "multisine"), *column(cells, "sweep")))
        return [name, f"{number(max(column(cells, 'worst_percent')), 2)} %", errors]

    peers = column(where(rows, case="plain PySINDy, m, c, k given"), "worst_percent")
    clean = the(rows, case="plain PySINDy, m, c, k given, clean")["worst_percent"]
    return [
        f"Yes: of {library} terms the three right ones and no other are found with every seed. That the plant is a "
        "mass on a spring with memory is told.",
        tabled(
            ("how the records were made", "worst coefficient off by", "test error [m]"),
            said("told", "benchmark"),
            said("not told", "benchmark, recipe not told"),
        ),
        "PySINDy's regression with the true mass, damping and stiffness, and the threshold that suits it best, is "
        f"{span(peers, 2)} % off, and {number(clean, 2)} % on clean data.",
    ]


def sindy_lag_trap(result: Result) -> list[str]:
    """A lag that looks like hysteresis under one rate."""
    rows = result["rows"]
    single = [row for row in rows if len(row["frequencies_hz"].split()) == 1]
    double = {row["plant"]: row["verdict"] for row in rows if len(row["frequencies_hz"].split()) == 2}
    require({row["verdict"] for row in single} == {"cannot be told from one rate"}, "one rate does not tell")
    require(double["published lag"] == "linear lag", "two rates show the lag")
    widths = {"published sparse model": result["published_widths"], "a pole and a zero": result["lag_widths"]}
    return [
        "Not always: a published sparse model of a piezo loop is a linear lag. A pole and a zero have its loop at 0.1 "
        "and 1 Hz.",
        tabled(
            ("width of the loop, of the stroke", "0.1 Hz", "1 Hz", "10 Hz"),
            *((name, *(percent(100 * width) for width in each)) for name, each in widths.items()),
        ),
        f'Under one rate all {len(single)} records, lag and Bouc-Wen law, are called "{single[0]["verdict"]}". Under '
        f'two rates the lag is called "{double["published lag"]}" and the law "{double["Bouc-Wen"]}".',
    ]


def adversarial_records(result: Result) -> list[str]:
    """Verdicts on records that are made to mislead."""
    seen, held_back = result["sets"]["seen"], result["sets"]["held back"]
    median_s, most_s = (
        max(part[f"{name}_cpu_seconds"] for part in (seen, held_back)) for name in ("median", "largest")
    )
    return [
        f"The verdict is right on {held_back['right']} of {held_back['records']} records that were held back. It is "
        f"right on {seen['right']} of {seen['records']} that were looked at while the limits were chosen.",
        f"The median record takes {median_s:.1f} s of processor time, the slowest {most_s:.1f} s. The records held "
        "back have other numbers, but are of the same kinds.",
    ]


# Control -------------------------------------------------------------------------------------------------------------


def lag_of_equation_1(result: Result) -> list[str]:
    """What a PID takes of the lag of equation (1), against robustness."""
    rows = sorted(result["rows"], key=lambda row: row["bound"])
    best, whole = "lag_reduction_percent", "{:.0f} %".format
    enough = [row["bound"] for row in rows if row[best] >= 90.0]
    require(not enough or min(enough) > 2.0, "90 % need more than the usual bound")
    needed = f"needs a bound of {min(enough):g}" if enough else f"is not reached at {rows[-1]['bound']:g}"
    return [
        f"Removing the paper's 90 % of the lag {needed} on the maximum sensitivity; usually at most 2 is allowed.",
        by_row(
            rows,
            ("bound on the maximum sensitivity", "bound", "{:g}".format),
            ("lag removed by the best PID", best, whole),
            ("by that of the worst search", "least_of_the_searches_percent", whole),
        ),
        "The paper's equation (1) has lag and no hysteresis. The plant is known exactly, nothing disturbs it, and the "
        "figures hold for this triangle and sampling.",
    ]


def _beside(rows: Sequence[Row]) -> str:
    """Sentences on what the reductions of some loops are worth."""
    require(all(row["stable"] for row in rows), "all loops are stable")
    limited, jump = (max(column(rows, name)) for name in ("limited_percent", "volts_per_pixel"))
    return (
        f"All loops are stable, and at a limit of the voltage in at most {percent(limited)} of the samples. One more "
        f"sample of delay raises their maximum sensitivity to at most {number(max(column(rows, _DELAYED)))}. A "
        f"pixel of the paper's camera would move their commands by up to {number(jump)} V."
    )


_DELAYED = "max_sensitivity_with_delay"


def compensation_matrix(result: Result) -> list[str]:
    """What each part of a controller adds."""
    rows = {row["controller"]: row for row in result["rows"]}
    held, with_n, normalised = result["parameters_within_5_percent"]
    names = "PID", "inverse + creep inverse", "model-following", "model-following, damped"

    def off(name: str, draws: Row) -> list[str]:
        return [name, *(percent(draws[key]) for key in ("median", "fifth_percentile", "worst_corner"))]

    keys = "hysteresis_reduction_percent", "residual_rms_reduction_percent", "worst_residual_rms_reduction_percent"
    reduced = [(name, *(percent(rows[name][key]) for key in keys)) for name in names]
    best = max(names, key=lambda name: float(rows[name][keys[0]]))
    return [
        f"Where the controller knows the actuator exactly, {best} removes the most hysteresis, "
        f"{percent(rows[best][keys[0]])}.",
        tabled(
            ("reduction", "hysteresis, triangle of 1 Hz", "vibration after a step, mode known", "mode 10 % off"),
            *reduced,
        ),
        f"A negative reduction is more vibration. {_beside(list(rows.values()))}",
        tabled(
            ("inverse alone, parameters within 5 %", "median", "5th percentile", "worst corner"),
            off("all but the exponent", held),
            off("the exponent too", with_n),
            off("in the law's normalised form", normalised),
        ),
    ]


def robustness(result: Result) -> list[str]:
    """Controllers on actuators that are not quite those that they were made for."""
    rows, kept = result["rows"], "hysteresis_reduction_percent"
    best = the(rows, controller="robust, EI", exponent="held")
    ahead, sudden = (best[f"residual_rms_reduction_percent{kind}_p5"] for kind in ("_known_ahead", ""))
    simple = (the(rows, controller=name) for name in ("PID", "inverse + creep inverse", "model-following"))
    return [
        f"With law, creep and mode each up to {result['spread_percent']:g} % off, the robust controller removes "
        f"{percent(best[f'{kept}_p5'])} of the hysteresis or more in 95 % of the draws. It is model-following with "
        "damping, a broad notch and an extra-insensitive (EI) shaper.",
        by_row(
            (best, *simple),
            ("hysteresis removed", "controller", str),
            ("draws", "draws", str),
            ("median", f"{kept}_p50", percent),
            ("fifth percentile", f"{kept}_p5", percent),
        ),
        f"Of the residual vibration it removes {percent(ahead)} in the fifth percentile for a step known ahead, and "
        f"{percent(sudden)} for a sudden one. Unstable draws: {best['unstable']}. Its gains were chosen by hand on "
        "other draws.",
    ]


def learning(result: Result) -> list[str]:
    """Repetition and prediction on actuators that are not quite the model."""
    rows, spread = result["rows"], result["spread_percent"]
    learned = where(rows, kind="iterative learning")
    slow = the(learned, reference="triangle of 1 Hz")
    require(slow["trials_to_noise"] <= 8, "eight trials reach the sensor's noise at 1 Hz")
    require(not sum(column(learned, "worse_than_first")), "no draw is worse after the last trial than in the first")
    first, last = "median_um_1", "median_um_10"
    steps = [row for row in rows if row["reference"].startswith("step")]
    milliseconds = lambda value: "not within 90 ms" if value is None else f"{1e3 * value:.1f} ms"  # noqa: E731
    return [
        f"With law, creep and mode each up to {spread:g} % off, {slow['trials_to_noise']} trials take the error of a "
        "triangle of 1 Hz to the sensor's noise in the median. No draw diverges.",
        by_row(
            learned,
            ("learned from trials, median rms in nm", "reference", str),
            ("first", first, nanometres),
            ("second", "median_um_2", nanometres),
            ("fourth", "median_um_4", nanometres),
            ("tenth", last, nanometres),
            ("largest of all draws", "largest_um", nanometres),
        ),
        "What a reference asks for above the low pass is not learned: the corners of 100 Hz excite a mode whose "
        "frequency is not known well.",
        by_row(
            [row for row in rows if row.get("margin") is not None],
            ("in a loop, rms in nm", "reference", str),
            ("controller", "kind", str),
            ("median", "median_um", nanometres),
            ("largest", "largest_um", nanometres),
        ),
        "Prediction brakes in time where the voltage has a limit.",
        by_row(
            steps,
            ("step within 0 to 70 V", "kind", str),
            ("overshoot, exact model", "overshoot_percent", percent),
            ("settled", "settling_time_s", milliseconds),
            ("overshoot, median of the draws", "median_overshoot_percent", percent),
            ("settled, median", "median_settling_time_s", milliseconds),
            ("overshoot, largest", "largest_overshoot_percent", percent),
        ),
    ]


def pixel_sensor(result: Result) -> list[str]:
    """Control through whole pixels."""
    rows = {row["controller"]: row for row in result["rows"]}
    best, pid = rows["inverse + creep inverse"], rows["PID"]
    true, measured = "hysteresis_reduction_percent", "measured_hysteresis_reduction_percent"
    stable = [row for row in result["rows"] if row["stable"]]
    fed_back = [row for row in stable if "PID" in row["controller"] or "follow" in row["controller"]]
    require(best[true] == max(column(stable, true)), "no feedback on pixels beats the inverse")
    require(pid not in stable, "a fast PID is in a limit cycle on pixels")
    return [
        f"Measured in whole pixels of {result['pixel_um']:g} um, the inverse of law and creep removes "
        f"{percent(best[true])} of the true hysteresis, without feedback and with the law known exactly. The pixels "
        f"show {percent(best[measured])}.",
        f"Feedback on pixels makes it worse: {span(column(fed_back, true), 3, ' %')} with the inverse. A fast PID "
        f"alone, whose command moves by {number(pid['volts_per_pixel'])} V for a pixel, is in a limit cycle on the "
        "pixels, although it is stable in linear theory. The camera is taken to be as fast as the controller.",
    ]


def rate_sweep(result: Result) -> list[str]:
    """Up to which rate compensation holds."""
    rows, key = result["rows"], "hysteresis_reduction_percent"
    controllers = "model-following", "inverse + creep inverse", "PID"
    some = [row for row in rows if row["controller"] in controllers and row["frequency_hz"] in (1.0, 10.0, 100.0)]
    worst = min(where(rows, controller="model-following"), key=lambda row: row[key])
    return [
        f"Model-following removes {percent(worst[key])} of the loop's width or more at every rate, and least at "
        f"{worst['frequency_hz']:g} Hz.",
        crossed("reduction of the loop's width at [Hz]", some, "controller", "frequency_hz", key),
        "Every controller knows the actuator exactly; experiment 15 says what becomes of that when it does not.",
    ]


def pid_hysteresis(result: Result) -> list[str]:
    """What a PID leaves."""
    rows, key = where(result["rows"], plant="law, creep, mode"), "hysteresis_reduction_percent"
    bounds = 2.0, min(column(rows, "max_sensitivity"))
    both = [row for row in rows if row["max_sensitivity"] in bounds]
    usual = where(rows, max_sensitivity=2.0)
    ended = column(result["rows"], "search_finished")
    least = min(column(where(result["rows"], max_sensitivity=2.0), "lag_share_percent"))
    return [
        f"A PID removes {span(column(usual, key), 3)} % of the width at a maximum sensitivity of 2, less at higher "
        f"rates. At least {percent(least, 0)} of the width that is left is lag, and would be there without hysteresis.",
        crossed("reduction by maximum sensitivity at [Hz]", both, "max_sensitivity", "frequency_hz", key),
        "The plant is law, creep and mode; a negative reduction is a wider loop. With one more sample of delay the "
        f"sensitivity rises from 2 to {number(max(column(usual, _DELAYED)))}. A pixel of the paper's camera would move "
        f"the command by {number(max(column(usual, 'volts_per_pixel')))} V. The search for the gains ended by its "
        f"tolerance in {sum(ended)} of {len(ended)} rows.",
    ]


def vibration(result: Result) -> list[str]:
    """Vibration after a step, by its size."""
    key, rows = "residual_rms_reduction_percent", result["rows"]
    names = "overshoot_reduction_percent", key, "settling_time_reduction_percent"
    stages = [row for row in where(rows, plant="Table 1") if row["controller"] in ("model-following", "robust, EI")]
    follow = where(stages, controller="model-following")
    limited = [f"{row['step_um']:g} um" for row in follow if row["limited_samples"]]
    plants = {name: where(rows, plant=name, controller="PID") for name in ("(4)", "(6)")}
    return [
        f"On Table 1's actuator, known exactly, model-following removes at least {percent(min(column(follow, key)))} "
        f"of the residual vibration. The voltage is limited in steps of {listed(limited)}.",
        crossed("residual vibration removed after a step of [um]", stages, "controller", "step_um", key),
        "The robust controller is that of experiment 15. The paper's plants are known exactly, too, without noise.",
        tabled(
            ("reduced by PID on the paper's plant", "overshoot", "residual vibration", "settling time"),
            *([name, *(span(column(each, key), 3, " %") for key in names)] for name, each in plants.items()),
        ),
    ]


def closed_loop_speed(result: Result) -> list[str]:
    """One loop here and elsewhere."""
    own, *peers = where(result["rows"], kind="loop")
    by_name = {row["name"]: row["times_hysim"] for row in peers}
    blocks = by_name["python-control alone"] / by_name["python-control, one compiled block"]
    require(blocks > 2.0, "most of python-control's time is spent on joining blocks")
    rows = sorted(peers, key=lambda row: float(row["times_hysim"]))
    return [
        f"A sample takes {number(own['microseconds_per_sample'], 2)} us in `close_loop`. All displacements agree to "
        f"{error_of(max(column(peers, 'largest_difference_um')))} um.",
        by_row(rows, ("the same loop elsewhere", "name", str), ("time, hysim = 1", "times_hysim", number)),
        "In python-control most of the time is spent on joining blocks, not on the law: one block is "
        f"{number(blocks, 2)} times faster than the same loop joined from blocks.",
    ]


# Other families ------------------------------------------------------------------------------------------------------


def preisach(result: Result) -> list[str]:
    """Preisach laws from reversal curves."""
    kinds = {"table read off": "read", "table fitted": "fitted", "smooth density": "smooth"}
    cells = [
        [str(row["curves"]), *(f"{number(row[f'{kind}_error_percent'], 2)} %" for kind in kinds.values())]
        for row in result["rows"]
    ]
    chosen, few = result["smoothness"], min(result["rows"], key=lambda row: float(row["curves"]))
    seconds, over = ([each[name] for each in chosen] for name in ("seconds", "over_best_strength"))
    worst = max(chosen, key=lambda each: float(each["over_best_strength"]))
    return [
        f"{few['curves']} curves predict a random input to {number(few['smooth_error_percent'], 2)} % where the "
        "density is fitted as a smooth one. The truth is a bank of relays with a smooth density, which suits all three "
        "methods.",
        tabled((f"reversal curves with {100 * result['noise']:g} % of noise", *kinds), *cells),
        f"On {len(chosen)} random densities, from triangles of four sizes, the smoothness that the default chooses is "
        f"{median(over):.2f} times as wrong as the best one in the median and {worst['over_best_strength']:.2f} times "
        f"at worst. The worst is a ridge {worst['width']:.2f} wide with {100 * worst['noise']:g} % of noise. "
        f"{sum(each > 1.15 for each in over)} densities are more than 1.15 times as wrong. A choice takes "
        f"{number(median(seconds), 2)} s in the median and {number(max(seconds), 2)} s at worst.",
    ]


def reversal_curves(result: Result) -> list[str]:
    """Reversal curves that were left out, and their density."""
    rows = result["rows"]
    told, measured = ([row for row in rows if ("best_correlation" in row) is known] for known in (True, False))
    beside = f", against {min(column(measured, 'correlation')):.3f} or more with the polynomial's" if measured else ""
    return [
        f"Every fifth curve is predicted with at most {number(result['worst_ratio'], 2)} times the error of a local "
        "polynomial with a smoothing factor of 3. Simulated curves have two ridges; measured ones are files of a "
        "magnetometer.",
        tabled(
            ("record", "smoothing", "law's error", "polynomial's", "drift"),
            *(
                [
                    row["record"],
                    f"{row['smoothing']:g}",
                    *(f"{number(row[f'{kind}_error_percent'], 2)} %" for kind in ("law", "regression")),
                    f"{number(row['drift_percent'], 2)} %",
                ]
                for row in rows
            ),
        ),
        f"The density has a correlation of {min(column(told, 'correlation')):.3f} or more with the true one"
        f"{beside}. It takes {number(max(column(rows, 'seconds')), 2)} CPU s at most.",
    ]


def dashpot(result: Result) -> list[str]:
    """A damper with and without its dashpot."""
    rows, key = result["rows"], "error_percent"
    without = max(column(where(rows, model="the law alone"), key))
    require(max(column(where(rows, model="law, dashpot and spring"), key)) < without, "the dashpot matters")
    return [
        f"Without its dashpot the model is up to {number(without, 2)} % of the range off at other "
        f"rates. It was identified at {result['fitted_at_hz']:g} Hz with {100 * result['noise']:g} % of noise.",
        crossed("error of the model [%] at a rate of [Hz]", rows, "model", "rate_hz", key, error_of),
        "The last one has the form of the truth, which is told.",
    ]


def friction(result: Result) -> list[str]:
    """LuGre against general solvers."""
    alone, mass = (where(result["rows"], problem=name) for name in ("law alone", "pulled mass"))
    own = where(alone, method="hysim")
    solvers = [row for row in alone if row["method"] in ("DOP853", "Radau", "LSODA")]
    lost = [row["sigma0"] for row in alone if row["method"].startswith("Runge-Kutta") and row["error"] is None]
    require(all(row["turns"] == 0 for row in own), "stiff bristles do not chatter")
    ours = the(mass, method="hysim", setting=result["own_tolerance_of_times"])
    finest = min(row["setting"] for row in mass if row["method"] != "hysim")
    theirs = [row for row in mass if row["method"] != "hysim" and row["setting"] == finest]
    return [
        "Along a given motion the law is exact to rounding: hysim's force is within "
        f"{at_rounding(max(column(own, 'error')))} of the breakaway force of the closed form, up to the largest "
        f"stiffness of {number(max(column(own, 'sigma0')), 1)} N/m. It does not chatter, and takes "
        f"{number(result['ns_per_sample_of_long_records'], 2)} ns a sample of a long record.",
        f"SciPy's solvers at {result['tolerance']:g} are within {error_of(max(column(solvers, 'error')))}. On a record "
        f"of {result['n_samples']} samples, where calling costs hysim the most, they take "
        f"{span(column(solvers, 'times_hysim'), 2)} times as long. A loop of fixed steps diverges from "
        f"{number(min(lost), 1)} N/m on.",
        by_row(
            theirs,
            ("a mass that sticks and slips", "method", str),
            ("time, hysim = 1", "times_hysim", error_of),
            ("error", "error", error_of),
        ),
        f"On the mass hysim takes {number(ours['ns_per_sample'] / 1000, 2)} us a sample for an error of "
        f"{error_of(ours['error'])}, and a general stiff solver is as good. The tolerance of a structure is a share of "
        "the largest drift, and bristles bend over a small part of it.",
    ]


# Studies and files ---------------------------------------------------------------------------------------------------


def shards(result: Result) -> list[str]:
    """Shards that are killed and begun again."""
    rows, (long, short) = result["rows"], result["shared"]
    require(min(column(rows, "kills")) >= 1, "every shard was killed")
    return [
        f"A study of {result['n_tasks']} tasks is computed in {len(rows)} shards, which are killed "
        f"{sum(column(rows, 'kills')):.0f} times at random moments. {result['columns_that_differ']} columns of the "
        "merged table differ from those of a study that nobody divided, except the seconds.",
        f"In all, {sum(column(rows, 'computed_twice')):.0f} unfinished tasks were computed again. A process that "
        f"computes {count(result['many'])} short tasks, with a store, takes {number(result['megabytes_of_many'])} MB.",
        f"With tasks of two seconds, two processes reach {long['efficiency_percent']:.1f} % of their speed without a "
        f"sweep. With {count(short['tasks'])} tasks of a millisecond they reach "
        f"{short['efficiency_percent']:.1f} %.",
    ]


def scaling(result: Result) -> list[str]:
    """What a sweep costs in addition to its tasks."""
    rows = where(result["rows"], workers=2)
    shared = [row for row in rows if row["kind"] in ("10 ms in a kernel", "10 ms with arrays", "fit")]
    short = the(rows, kind="microsecond", executor="threads", tasks=100_000)
    one, other = (the(rows, kind=f"laws on Table 1, n = {n}")["seconds"] for n in ("1", "1.5"))
    few, many = (number(result["workers_at_saturation"][f"{task} s"], 2) for task in ("0.01", "1"))
    return [
        f"A task of less than a microsecond costs {number(short['overhead_microseconds'], 2)} us on threads.",
        crossed(
            "efficiency of two workers [%], by task", shared, "kind", "executor", "efficiency_percent", "{:.0f}".format
        ),
        f"A million laws on the paper's points take {number(one, 2)} s with n = 1. With n = 1.5 they take "
        f"{number(other, 2)} s.",
        "A model that is fitted to these rows lets a dask cluster saturate at "
        f"{few} workers with tasks of 10 ms. With tasks of 1 s it saturates at {many}; no larger cluster was tried.",
    ]


def fuzz(result: Result) -> list[str]:
    """Damaged inputs to the command line."""
    kinds = listed(list(dict.fromkeys(f"{row['damaged']}" for row in result["rows"])))
    require(
        result["inputs"] == sum(result[end] for end in ("exit 0", "exit 1", "exit 2")), "every run ends in 0, 1 or 2"
    )
    return [
        f"Of {count(result['inputs'])} damaged inputs ({kinds}), each handed to a command, {result['broken']} end in "
        f"a traceback, in more than one line of error or with a file half written. {count(result['exit 0'])} are "
        f"accepted, {count(result['exit 1'] + result['exit 2'])} refused.",
    ]


# Camera --------------------------------------------------------------------------------------------------------------


def registration(result: Result) -> list[str]:
    """Displacement from frames, compared with scikit-image."""
    rows = result["rows"]

    def at(method: str, snr: int, name: str = "rms_px") -> list[float]:
        return column(where(rows, method=method, snr_db=snr), name)

    others = [name for name in dict.fromkeys(row["method"] for row in rows) if name not in ("hysim", "whole pixels")]
    peer = min(others, key=lambda name: max(at(name, 30)))
    levels = sorted({row["snr_db"] for row in rows}, reverse=True)

    def ends(method: str) -> list[str]:
        errors = [at(method, snr) for snr in levels]
        return [method, *(f"{number(median(each), 2)} ({number(max(each), 2)})" for each in errors)]

    bias = max(value for snr in levels if snr >= 20 for value in at("hysim", snr, "largest_bias_px"))
    honest = column(where(rows, method="hysim"), "error_over_standard_error")
    speed = result["speed_and_memory"]
    return [
        f"A displacement is at most {number(max(at('hysim', 20)), 2)} pixels off in the rms at 20 dB. The error is "
        f"{span(honest, 2)} times its standard error. Whole pixels are {number(max(at('whole pixels', 30)), 2)} pixels "
        "off.",
        tabled(("rms error [pixels]: median (worst)", *(f"{snr} dB" for snr in levels)), *map(ends, ("hysim", peer))),
        f"The {len({row['picture'] for row in rows})} kinds of picture were not used while developing, and "
        f"scikit-image has its better setting. The bias is at most {number(bias, 2)} pixels at 20 dB and better. One "
        f"core registers {min(column(speed, 'frames_per_second')):.0f} frames of 512 x 512 pixels a second. It needs "
        f"at most {number(max(column(speed, 'peak_mib')))} MiB for up to {speed[-1]['frames']} frames.",
    ]


def virtual_rig(result: Result) -> list[str]:
    """What the camera of Table 1 costs."""
    lines = {line["measured"]: line for line in result["summary"] if line["measured"] != "Table 1"}
    key, width, tables = "hysteresis_reduction_percent", "width_error_percent", lines["whole pixels"]["tables"]
    cells = [
        (
            name,
            *(percent(line[key][end]) for end in ("median", "least")),
            " to ".join(f"{error_of(line[width][end])} %" for end in ("least", "most")),
            str(line["width_covers"]),
        )
        for name, line in lines.items()
    ]
    fine, shaken = (lines[name][key]["least"] for name in ("parts of a pixel", "whole pixels, shaken"))
    require(shaken < 0.0, "shaking makes the loop wider at worst")
    return [
        f"With displacements to parts of a pixel the inverse of the identified law removes {percent(fine)} of the true "
        f"hysteresis at worst. The inverse of the true law removes {percent(result['true_law_reduction_percent'])}.",
        tabled(
            (f"{tables} runs", "removed, median", "worst", "error of the loop's width", "runs in its interval"), *cells
        ),
        "A known actuator is measured under a simulated microscope; whole pixels without shaking give the same result "
        "in every run. Where the microscope shakes, a controller may do harm: at worst the loop is "
        f"{number(1.0 - 0.01 * shaken, 2)} times as wide as without it. Family and form of the true law are told.",
    ]


# Outside Python ------------------------------------------------------------------------------------------------------


def one_law_everywhere(result: Result) -> list[str]:
    """Differences between a step in Python and its translations, and what they cost."""
    rows, ran = result["rows"], result["run"]
    worst = {name: column(rows, f"worst_{name}") for name in ran}
    require(max(map(max, worst.values())) <= result["promised"], "every number is within what is promised")
    slowest = max(rows, key=lambda row: row["ns_c_most"])
    gains = [row["ns_numba"] / row["ns_c"] for row in rows]
    board = result["cortex_m7_bytes"]
    on_board = (
        "The size on a Cortex-M7 was not measured."
        if board is None
        else f"On a Cortex-M7 Bouc-Wen with n = 1 is {count(int(board))} bytes of code, without the C library. "
        f"Its state is {count(int(result['cortex_m7_ram_bytes']))} bytes."
    )
    missing = f" Not run: {listed(result['not_run'])}." if result["not_run"] else ""
    inverse = [number(result[f"general_inverse_ns{end}"], 2) for end in ("", "_most", "_numba")]
    return [
        f"Yes: in {count(int(result['compared']))} comparisons with Python's compiled step the largest difference is "
        f"{error_of(max(map(max, worst.values())))} of the range, and no sanitizer reports anything. Compared are "
        f"{len(rows)} families, inverses, plants and controllers, each in part as units.{missing}",
        tabled(
            ("difference from Python, of the range", *ran),
            ("median of the families", *(error_of(median(each)) for each in worst.values())),
            ("worst", *(error_of(max(each)) for each in worst.values())),
        ),
        f"A sample takes {number(median(column(rows, 'ns_c')), 2)} ns in C in the median and "
        f"{number(slowest['ns_c_most'], 2)} ns at worst ({slowest['family']}). In a family's median numba's pointer "
        f"takes {span(gains, 2)} times as long. The inverse of Bouc-Wen with a general exponent takes {inverse[0]} ns "
        f"in the median of its laws and {inverse[1]} ns at worst, {inverse[2]} ns through numba's pointer.",
        on_board,
    ]


def controllers_in_c(result: Result) -> list[str]:
    """Tracking controllers in C on the measurements of their loops."""
    equal = sum(row["worst_difference"] == 0.0 for row in result["rows"])
    most = max(column(result["rows"], "at_limits_percent"))
    return [
        f"Of {count(result['laws'])} controllers, each with the inverse of another law, {count(equal)} have the "
        f"bits of Python in C, and the worst differs by {number(result['worst_difference'])} of the range. They are "
        f"run in C on the {count(result['samples'])} measurements of their own loops, at the voltage limits in "
        f"{result['least_at_limits_percent']:.2g} to {most:.0f} % of the samples.",
    ]


def first_contact(result: Result) -> list[str]:
    """What every verb says of one fit, and the flow of the README on records of others."""
    require(result["largest_difference"] < 1e-9, "every verb says the same number")
    require(result["residuals_not_the_models"] == 0, "each residual is that of the returned model")
    require(result["outside_without_warning"] == 0, "no command leaves the range of its record without a warning")
    require(result["over_floor_median"] <= 1.3 and result["over_floor_worst"] <= 2.0, "the error is near the floor")
    require(result["held_percent"] >= 90.0, "intervals hold the true parameters")
    require(result["baber_noori_heals"] == 0, "no damage heals")
    return [
        f"On {count(result['records'])} records at least {result['verbs']} verbs report the same fit, to "
        f"{number(result['largest_difference'], 1)} %. {count(result['measured'])} of the records are measured.",
        f"On {count(result['noisy_twins'])} simulated records with noise of the input, the error of the returned model "
        f"is {number(result['over_floor_median'], 2)} times that of the true law with the best filter in the median, "
        f"and {number(result['over_floor_worst'])} times at worst. Intervals at 95 % hold "
        f"{percent(result['held_percent'])} of {count(result['parameters'])} parameters.",
        f"The README's flow ran on {count(result['flows'])} records, with a warning of every command beyond the "
        f"record. On {count(result['flows_refused'])} more the law has no inverse, and says so. C and Python differ by "
        f"at most {number(result['c_apart_worst'], 2)} of the span of the commands.",
    ]


def page_redraw(result: Result) -> list[str]:
    """Redraws of a page after a slider, compared with Python and Matplotlib."""
    rows, promised = result["rows"], result["promised_ms"]
    medians = column(rows, "median_ms")
    ratios = [row["notebook_median_ms"] / row["median_ms"] for row in rows]
    slowest, last = max(rows, key=lambda row: row["median_ms"]), max(rows, key=lambda row: row["worst_ms"])
    require(max(medians) <= promised, "a redraw takes at most what is promised in the median")
    return [
        f"A redraw takes {span(medians, 2)} ms in the median ({slowest['model']} takes longest). The slowest takes "
        f"{number(last['worst_ms'], 2)} ms ({last['model']}). The same law, measures and figure by Python and "
        f"Matplotlib take {span(ratios, 2)} times as long.",
        f"Each of {len(rows)} models has {count(rows[0]['samples'])} samples and up to {count(result['keys'])} slider "
        "steps. The browser's painting afterwards is not in these times.",
    ]


def structures_work_precision(result: Result) -> list[str]:
    """Frames in earthquakes, compared with OpenSees, SciPy and plain loops."""
    frame = where(result["rows"], problem="three storeys, n = 2")
    own = the(frame, setting="tolerance 1e-08")
    finest = [row for row in result["beside_opensees"] if row["opensees"].endswith("64 substeps")]
    (steel,) = (row for row in result["asked"] if row["what"] == "Steel01, same Newmark: difference of drifts")
    tower = the(result["rows"], problem="twenty storeys on isolators", setting="tolerance 1e-08")
    equal = [row for row in frame if row["error"] <= 1e-4]
    verlet = min(row["ns_per_term"] for row in equal if row["method"].startswith("Verlet"))
    ours, scipy = (min(row["ns_per_term"] for row in equal if row["tool"] == tool) for tool in ("hysim", "SciPy"))
    missed = [row["what"] for row in result["asked"] if not row["reached"]]
    require(
        min(row["times_more_exact"] for row in result["beside_opensees"]) > 1.0, "hysim is more exact at equal cost"
    )
    return [
        f"The drifts of three Bouc-Wen storeys are {error_of(own['error'])} wrong at the default tolerance. At the "
        f"error of OpenSees with 64 steps a sample, hysim is {span(column(finest, 'times_faster'), 2)} times faster.",
        tabled(
            ("three storeys at ductility 5, errors up to 1e-4", "time of a sample and element [ns]"),
            ("hysim", number(ours)),
            ("the faster of SciPy's methods", number(scipy)),
            ("a plain compiled Verlet loop around hysim's laws", number(verlet)),
        ),
        f"With the same Newmark steps OpenSees' Steel01 and hysim's law differ by {error_of(steel['value'])}. The "
        f"drifts of twenty storeys on isolators are {error_of(tower['error'])} wrong. "
        + (
            f"Figures that were not reached: {listed(missed)}."
            if missed
            else "All figures that were asked for are reached."
        ),
    ]


def tracking(result: Result) -> list[str]:
    """Numbers of a law that drift, along a record and in a loop."""
    rows = result["rows"]
    points, told = (
        where(rows, part="tracking", method="sigma-point", drift=drift) for drift in ("most likely", "told")
    )
    least, walks = where(rows, part="tracking", method="recursive least squares"), where(rows, part="walk")
    fixed, adaptive = (where(rows, part="loop, gain and exponent", method=method) for method in ("fixed", "adaptive"))
    alone = where(rows, part="loop, gain alone", method="adaptive")
    every = [*column(adaptive, "reduction_percent"), *column(alone, "reduction_percent")]
    require(min(every) >= 97.0, "the adaptive inverse keeps at least 97 %")
    require(max(column(fixed, "reduction_percent")) <= 0.87 * min(every), "the fixed inverse falls behind")
    errors = [median(column(each, "gain_error_percent")) for each in (points, least, told)]
    require(errors[0] < errors[1] < errors[2], "with the likely drift better than recursive least squares, told worse")
    pooled = [mean(column(walks, f"coverage_{name}_percent")) for name in ("gain", "n")]
    require(pooled[1] < 0.95 * pooled[0], "bands of an exponent that hardly walks hold it less than those of the gain")
    return [
        f"Yes: a gain that falls by 20 % is followed to {error_of(errors[0])} % rms in the median of {len(points)} "
        f"seeds. Recursive least squares with the best of six forgetting factors reaches {error_of(errors[1])} %. With "
        f"a drift of wrong size, told by the user, it is {error_of(errors[2])} %.",
        f"Where gain and exponent walk, bands at 95 % contain the gain in {number(pooled[0], 3)} % of the samples and "
        f"the exponent in {number(pooled[1], 3)} %: the bands of the exponent are too narrow.",
        f"In a loop the adaptive inverse removes {span(column(adaptive, 'reduction_percent'))} % of the hysteresis at "
        f"the end, the fixed one {span(column(fixed, 'reduction_percent'))} %. Law, noise and the size of the jump are "
        "told, and in the loop the sizes of the drift.",
    ]


def design(result: Result) -> list[str]:
    """Inputs that tell the parts of a whole actuator apart."""
    rows = {row["input"]: row for row in result["rows"]}
    designed, usual = rows["designed"], [row for name, row in rows.items() if name != "designed"]
    require(all(row["converged"] == row["draws"] for row in rows.values()), "every search converged")
    unit, worst = "median_error_in_expected_of_designed", "worst_error_in_expected_of_designed"
    require(designed[unit] < min(column(usual, unit)), "the designed input has the smallest errors in the median")
    require(designed[worst] < min(column(usual, worst)), "and at worst")
    predicted = {name: row["median_prediction_in_noise"] for name, row in rows.items()}
    require(predicted["multisine"] < predicted["designed"], "the multisine predicts better")
    return [
        f"Yes: on {designed['draws']} simulated stages the designed input has the smallest errors of the parameters. "
        "For prediction the multisine is better.",
        by_row(
            rows.values(),
            ("input", "input", str),
            ("median error of a parameter", unit, error_of),
            ("worst", worst, error_of),
            ("error on an unseen record, noise = 1", "median_prediction_in_noise", error_of),
        ),
        "The errors of parameters are in the standard errors that are expected of the designed input. It was designed "
        "for parameters that are 10 % off. Family of the law, sharpness and memory are told.",
    ]


def channels(result: Result) -> list[str]:
    """Parameters that follow a supply or a temperature."""
    rows, simulated, measured = result["rows"], result["simulated"], result["measured"]
    damper = {row["model"]: row for row in where(rows, case="simulated damper, a supply left out")}
    stack = {row["model"]: row for row in where(rows, case="temperature along a record")}
    jointly, warm, cold = damper["in the supply"], stack["in the temperature"], stack["one law for the record"]
    others = [row for name, row in damper.items() if name != "in the supply"]
    require(all(row["median_error_percent"] > jointly["median_error_percent"] for row in others), "the channel is best")
    cells = [(row["model"], f"{error_of(row['median_error_percent'])} %") for row in (jointly, *others)]
    separate, joint = measured["rmse_of_a_law_each"], measured["rmse_in_the_supply"]
    squares = [sum(error**2 for error in errors) for errors in (joint, separate)]
    require(squares[0] <= 1.1**2 * squares[1], "one law in the supply fits nearly as well as a law for each")
    return [
        "Yes, within the supplies that it was identified at: at a further one between them, the force of a simulated "
        f"damper is predicted to {error_of(jointly['worst_error_percent'])} % of its range or better. "
        f"{number(jointly['intervals_that_hold_percent'])} % of the 95 % intervals contain the truth.",
        tabled(("law of the simulated damper", f"median error over {simulated['seeds']} seeds, of the range"), *cells),
        f"A stack whose temperature drifts is predicted at 40 degC to {error_of(warm['median_error_percent'])} %, by "
        f"one law for the record to {error_of(cold['median_error_percent'])} %.",
        tabled(
            ("rms error on a measured damper [N]", "0 V", "0.88 V"),
            ("in the supply", *map(number, joint)),
            ("a law for each supply", *map(number, separate)),
        ),
        f"Outside its supplies the law fails: a third record of this damper would need "
        f"{measured['supply_of_4_4']:.2f} V, and the law is {number(measured['rmse_of_4_4'])} N off. Supplies, law and "
        "exponent of the simulated damper are told.",
    ]


def evidence(result: Result) -> list[str]:
    """Which model the paper's points prefer."""
    bridge, nested = (where(result["rows"], method=name) for name in ("bridge", "nested"))
    found = [row for row in bridge if row["error"] is not None]
    whole = [row for row in found if len(where(found, model=row["model"])) == 3]
    ordered = sorted(where(whole, factor=1.0), key=lambda row: -row["log_evidence"])
    require(result["largest_error"] < 0.3, "errors of ln Z are small")
    values = [(row["model"], f"{row['log_evidence'] - ordered[0]['log_evidence']:.1f}") for row in ordered]
    seconds = column(whole, "cpu_seconds")
    beside = sum(the(found, model=row["model"], factor=1.0)["cpu_seconds"] for row in nested)
    return [
        f"{result['sentence'][0].upper()}{result['sentence'][1:]}. These are {len(ordered)} models, with the rounding "
        "to pixels as noise, and prior boxes that are halved, unchanged and doubled. Half boxes cut off the optimum of "
        "some models.",
        tabled(("model, with unchanged boxes", "ln Z, less that of the first"), *values),
        f"Errors of ln Z by bridge sampling are at most {error_of(result['largest_error'])}. Nested sampling of "
        f"{len(nested)} of the models differs by at most {number(result['largest_difference_of_methods'], 2)} of its "
        f"standard errors, and takes {number(sum(column(nested, 'cpu_seconds')) / beside, 2)} times as long.",
        f"An evidence by bridge sampling takes {number(median(seconds))} s of processor time in the median and "
        f"{number(max(seconds))} s at worst.",
    ]


def posterior(result: Result) -> list[str]:
    """How fast posteriors are drawn, and how often their intervals hold the truth."""
    own, plain = result["speeds"]
    first, second = result["pooled_percent_of_halves"]
    seconds = [draw["cpu_seconds"] for draw in result["draws"]]
    require(own["effective_samples"] >= 10_000, "10 000 effective samples of the law of Table 1")
    return [
        f"{count(round(own['effective_samples']))} effective samples of the law on the paper's points take "
        f"{number(own['cpu_seconds'])} s of processor time. The posterior has three separate optima (R-hat at most "
        f"{own['rhat']:.3f}). emcee's own moves on a log-likelihood by hand, with a loop over the walkers, take "
        f"{number(own['effective_per_second'] / plain['effective_per_second'])} times as long.",
        tabled(
            (f"95 % intervals that hold the truth, in {count(len(seconds))} draws of similar laws", "%"),
            ("all", f"{result['pooled_percent']:.1f} (standard error {result['standard_error_percent']:.1f})"),
            ("in the two halves of the draws", f"{first:.1f} and {second:.1f}"),
            ("by parameter", f"{result['least_percent']:.0f} to {result['most_percent']:.0f}"),
            ("without the draws with too few effective samples", f"{result['pooled_percent_of_mixed']:.1f}"),
        ),
        f"A draw takes {number(median(seconds))} s in the median and {number(max(seconds))} s at worst. In "
        f"{len(result['seeds_not_mixed'])} draws fewer than {count(result['asked_effective'])} effective samples are "
        f"reached after {count(result['most_steps'])} steps.",
    ]


def portfolio(result: Result) -> list[str]:
    """A million buildings in 25 earthquakes."""
    rows, minutes = result["rows"], result["minutes_a_million"]
    damage = result["damage"].items()
    return [
        f"A million histories take {span(minutes)} min on two cores with stores. "
        f"This is measured on {result['computed_shards']} of {count(result['shards'])} shards; "
        f"all buildings in all earthquakes would take {number(result['hours_of_all'], 2)} hours.",
        by_row(
            rows,
            ("method, processor time", "method", str),
            ("a million histories on two cores [min]", "minutes_a_million", number),
            ("median error of the largest drift", "median_error", error_of),
            ("worst", "worst_error", error_of),
        ),
        tabled(
            ("class, invented", "peak acceleration of extensive damage in half of the buildings [g]"),
            *((name, f"{each['medians'][2]:.2f} (dispersion {each['dispersions'][2]:.2f})") for name, each in damage),
        ),
    ]


def components(result: Result) -> list[str]:
    """Rules of structural components compared with OpenSees, calibration and spectra."""
    laws = ("IbarraMedinaKrawinkler", "FolzFiliatrault", "BoucWenBaberNoori", "Preisach")
    tests = [
        {"law": law, **result[f"{law}_error_percent"], **result[f"{law}_seconds"], **result.get(f"{law}_numbers", {})}
        for law in laws
    ]
    systems = result["spectrum_records"] * result["spectrum_periods"]
    return [
        by_row(
            result["rules"],
            ("law", "law", str),
            ("material of OpenSees", "material", str),
            ("difference with 20 steps a stroke [%]", "difference_20_percent", error_of),
            ("with 2 000", "difference_2000_percent", error_of),
        ),
        by_row(
            tests,
            ("law, simulated tests with 0.5 % of noise", "law", str),
            ("error, median [%]", "median_error_percent", number),
            ("worst", "worst_error_percent", number),
            ("CPU s", "median_seconds", number),
            ("worst", "worst_seconds", number),
        ),
        crossed("error [%] on measured records", result["measured"], "record", "law", "error_percent", "{:.1f}".format),
        f"The numbers of a law come back to {number(tests[0]['median_off_percent'], 2)} and "
        f"{number(tests[1]['median_off_percent'], 2)} % in the median. A spectrum of constant ductility of {systems} "
        f"oscillators takes {number(result['spectrum_seconds'], 2)} s on two cores. A loop in OpenSees with one step a "
        f"sample would take {number(result['their_seconds_in_all'], 2)} s on one, from a bracket on; its strengths are "
        f"off by {number(result['their_strength_worst_off_percent'], 1)} % at worst.",
    ]


def cores(result: Result) -> list[str]:
    """The field of a core by its flux density, with and without a known begin, and cells."""
    return [
        by_row(
            result["rows"],
            ("cores differ by [%]", "differ_percent", number),
            ("law", "model", str),
            ("error, median [%]", "median_percent", number),
            ("mean", "mean_percent", error_of),
            ("95th percentile", "high_percent", error_of),
            ("worst", "worst_percent", error_of),
            ("CPU s", "seconds", number),
        ),
        by_row(
            result["measured"],
            ("measured loops, and a cell", "core", str),
            ("error, mean of the amplitudes [%]", "mean_percent", number),
            ("worst", "worst_percent", number),
        ),
        f"The third cycle of a cell is predicted to {number(result['median_cell_error_over_noise'], 3)} times the "
        f"noise in the median and {number(result['worst_cell_error_over_noise'], 3)} at worst. The interval at 95 % "
        f"holds the rate of {result['rates_in_interval']} of 100 cells.",
    ]


def jiles_atherton(result: Result) -> list[str]:
    """How exact the law of magnetic cores is."""
    digits, there, back = result["digits"], *(result["invariant"][way] for way in ("forwards", "inverse"))
    rows, trip, others = result["rows"], result["round_trip"], result["spellings"]["errors"]
    require(there["violations"] == back["violations"] == 0, "more samples on a branch change nothing")
    own = where(rows, method="hysim")
    cells = [
        (method, count(steps), span(column(each, "error"), 2), span(column(each, "times_hysim"), 2))
        for method in ("Runge-Kutta 4", "Euler")
        for steps in (200, 2_000)
        for each in [where(rows, method=method, steps=steps)]
    ]
    return [
        f"The law is exact to rounding: {count(digits['laws'])} laws are at most {at_rounding(digits['worst'])} of the "
        f"range off dM/dH integrated with 30 digits. Driven by B, {count(trip['laws'])} laws return it to "
        f"{error_of(trip['worst'])} of the range at worst.",
        tabled(
            ("method over H", "steps a stroke", "error, of the range", "time of a sample, hysim = 1"),
            ("hysim", "any", f"at most {error_of(max(column(own, 'error')))}", "1"),
            *cells,
        ),
        f"More samples on a branch change no output of {count(there['cases'])} hostile laws and as many inverses by "
        f"more than is allowed; the largest change is {number(max(there['worst_share'], back['worst_share']), 2)} of "
        f"that. {count(there['jumping'])} of these laws jump, in one step and in many.",
        f"Other spellings of the equations ({'; '.join(others)}) differ from hysim's law by {span(others.values(), 2)} "
        f"of the range, each with its constants and {count(result['spellings']['steps'])} Runge-Kutta steps a stroke.",
    ]


def magnetic_loops(result: Result) -> list[str]:
    """Measured loops of cores by seven families, and Jiles-Atherton fits compared with an evolution."""
    rows, sets = result["rows"], result["sets"]
    own, evolved = (where(rows, law=f"Jiles-Atherton{name}") for name in ("", ", differential evolution"))
    require(all(each["default_over_evolution_exactly"] <= 1.001 for each in sets.values()), "no evolution is better")
    require(all(each["default_over_refined"] <= 1.01 for each in sets.values()), "the default finds the best optimum")
    apparent = [name for name, each in sets.items() if each["default_over_evolution"] > 1.001]
    cores = [row["set"] for row in where(rows, law="Tellinen")]
    first, key, left_out = where(rows, set=cores[0]), "worst_error_percent", "left_out_percent"
    fits = [
        min((row for row in where(rows, set=core) if row not in evolved), key=lambda row: row[key]) for core in cores
    ]
    best = listed([f"{row['law']} for {row['set']}" for row in fits])
    laws = [row["law"] for row in sorted(first, key=lambda row: float(row[key])) if row not in evolved]
    errors = {core: {row["law"]: error_of(row[key]) for row in where(rows, set=core)} for core in cores}
    errors[f"middle amplitude of {cores[0]}, left out"] = {law: error_of(the(first, law=law)[left_out]) for law in laws}
    return [
        f"A default call for `hs.JilesAtherton` finds the best law of each of {len(sets)} sets of measured loops, in "
        f"{span(column(own, 'cpu_seconds'), 2)} s of processor time. A differential evolution on a law by hand takes "
        f"{span(column(evolved, 'cpu_seconds'), 2)} s and finds no better one. It seems better on "
        f"{listed(apparent) if apparent else 'no set'}, by the error of its 200 steps a branch.",
        tabled(
            ("error of the worst amplitude, % of its range", *errors),
            *([law, *(each[law] for each in errors.values())] for law in laws),
        ),
        f"The law that fits best depends on the core: {best}. All amplitudes of a core have one set of constants.",
    ]


def whole_actuator(result: Result) -> list[str]:
    """Law, creep, mode and delay of simulated stages, at once."""
    whole = the(result["rows"], model="whole actuator")
    require(whole["worst_error_in_noise"] < 1.5, "every prediction is within 1.5 times the noise")
    require(whole["converged"] == whole["draws"], "every search converged")
    share, parts = result["intervals_that_hold_percent"], result["intervals_that_hold_percent_by_part"]
    require(share >= 90.0, "the intervals hold")
    names = [name.removesuffix(".percent").rpartition(".")[2].replace("_", " ") for name in parts]
    return [
        "Yes: a sine of a rate and amplitude that no record holds is predicted to "
        f"{number(whole['worst_error_in_noise'], 2)} times the noise of the sensor or better. The law with a transfer "
        "function is identified from the one record that shows a mode.",
        by_row(
            result["rows"],
            ("model", "model", str),
            ("stages", "draws", str),
            ("median error, noise = 1", "median_error_in_noise", error_of),
            ("worst", "worst_error_in_noise", error_of),
            ("processor time of a fit [s], median", "median_cpu_seconds", error_of),
            ("worst", "worst_cpu_seconds", error_of),
        ),
        f"{number(share, 3)} % of {result['intervals']} intervals at 95 % hold the truth. The family of the law, the "
        "creep's bank and the number of modes were told, and the stages are of the models searched.",
        tabled(("intervals that hold", *names), ("share", *(f"{number(value)} %" for value in parts.values()))),
    ]


def mirror(result: Result) -> list[str]:
    """Laws of three piezos before common modes, and lines instead of these, on a mirror that was measured."""
    rows, levels = result["rows"], ("100", "200", "300")
    require(all(row["success"] for row in rows), "every search converged")
    outputs = list(dict.fromkeys(row["output"] for row in rows))
    errors = {(row["output"], row["model"]): [row[f"test_{level}_percent"] for level in levels] for row in rows}
    ratios = [
        [law / line for law, line in zip(values, errors[output, "lines"], strict=True)]
        for (output, model), values in errors.items()
        if not model.startswith("lines")
    ]
    low, between, high = zip(*ratios, strict=True)
    require(min(*low, *between, *high) > 0.9, "laws explain little of what lines leave")
    alone = [errors[output, "lines at 300 mV"][2] / errors[output, "lines"][2] for output in outputs]
    require(max(alone) < 0.5, "lines for one level alone are much better")
    shifts = []
    for output in outputs:
        first, last = (result["frequencies_hz"][f"{output}, lines at {level} mV"][:4] for level in (100, 300))
        shifts += [100.0 * (1.0 - b / a) for a, b in zip(first, last, strict=True)]
    cells = {", ".join(name): values for name, values in errors.items()}
    cells |= {
        f"published, {kind} model, mean of three displacements": values
        for kind, values in result["published_percent"].items()
    }
    return [
        f"Hardly: with laws before the modes the error is {span([*low, *high], 3)} times that of lines at the levels "
        f"that were identified. At the level between it is {span(between, 3)} times that of lines.",
        tabled(
            ("error, % of the standard deviation", *(f"{level} mV" for level in levels)),
            *((name, *map(number, values)) for name, values in cells.items()),
        ),
        "What they lack is in the modes: lines identified at one level alone fit that level much better. From the "
        f"lowest to the highest level the four lowest frequencies fall by {span(shifts, 2)} %.",
        f"The search was told where {len(result['frequencies_hz'][f'{outputs[0]}, lines at 100 mV'])} modes begin, and "
        f"takes {span(column(rows, 'cpu_seconds'), 2)} s of processor time. The test is a subset of the published one.",
    ]


GROUPS: dict[str, tuple[Finding, ...]] = {
    "Evaluation and speed": (
        exact_step,
        work_precision,
        structures_work_precision,
        portfolio,
        components,
        cores,
        batch,
        cold_start,
        more_samples,
        wear_and_pinching,
        jiles_atherton,
    ),
    "Identification": (
        benchmark_bouc_wen,
        transfer_functions,
        table1_models,
        first_contact,
        recovery,
        all_families,
        nested_table1,
        simulated_twins,
        measured_records,
        choice,
        identified_frame,
        channels,
        posterior,
        evidence,
        magnetic_loops,
        whole_actuator,
        design,
        mirror,
    ),
    "Discovery": (sindy_recovery, sindy_table1, sindy_benchmark, sindy_lag_trap, adversarial_records),
    "Control": (
        lag_of_equation_1,
        compensation_matrix,
        robustness,
        learning,
        pixel_sensor,
        rate_sweep,
        pid_hysteresis,
        vibration,
        closed_loop_speed,
        tracking,
    ),
    "Other families": (preisach, reversal_curves, dashpot, friction),
    "Studies and files": (shards, scaling, fuzz),
    "Camera": (registration, virtual_rig),
    "Outside Python": (one_law_everywhere, controllers_in_c, page_redraw),
}
