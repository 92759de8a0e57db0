"""What each experiment found, in one to three sentences that are computed from its stored result.

Each function has the name of a folder of `experiments/results`. It takes the content of `result.json` and returns
sentences. No number stands in a sentence that is not read from the result. A claim that rests on a comparison is
made by `require`, which raises `ValueError` where the result no longer supports it, so that a sentence cannot outlive
its numbers. Each says the bad end beside the median or the best, the best peer beside hysim, and what a method was
told that a user would not know.
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


def listed(parts: Sequence[str]) -> str:
    """Words joined by commas and an "and"."""
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"


def tabled(*rows: Sequence[str]) -> str:
    """A table of Markdown; the first row names the columns."""
    head, *others = (f"| {' | '.join(row)} |" for row in rows)
    return "\n".join(["", head, "|---" * len(rows[0]) + "|", *others, ""])


# Evaluation and speed ------------------------------------------------------------------------------------------------


def exact_step(result: Result) -> list[str]:
    """Errors and times of the exact step beside integrators in Python."""
    rows = result["rows"]
    methods = [name for name in dict.fromkeys(row["method"] for row in rows) if name != "hysim"]
    own = where(rows, method="hysim")

    def beside(name: str) -> str:
        peers = where(rows, method=name)
        return f"{span(column(peers, 'time_ratio'))} times as long at errors of {span(column(peers, 'error'), 2)}"

    fastest = min(methods, key=lambda name: max(column(where(rows, method=name), "time_ratio")))
    closest = min(methods, key=lambda name: max(column(where(rows, method=name), "error")))
    (lsoda,) = (name for name in methods if "LSODA" in name)
    near = result["lsoda_from_near_starts"]
    require(min(column(rows, "time_ratio")) == 1.0, "no integrator is faster")
    return [
        f"On {count(result['samples'])} samples, with n = {listed([format(n, 'g') for n in column(own, 'n')])}, the "
        f"largest error of the law is {error_of(max(column(own, 'error')))} of the memory's range.",
        f"The fastest of the integrators, {fastest}, takes {beside(fastest)}; the most accurate, {closest}, "
        f"{beside(closest)}; {lsoda}, {beside(lsoda)}; from {near[0]['starts']} starts that differ by less than 1e-11 "
        f"the errors of LSODA are {error_of(min(column(near, 'least')))} to {error_of(max(column(near, 'most')))}.",
        "All of these call a right-hand side in Python; compiled ones are in experiment 03.",
    ]


def work_precision(result: Result) -> list[str]:
    """Time against error beside other packages and C, driven and as an oscillator."""
    driven = where(result["rows"], problem="driven, n = 1")
    own, in_c = the(driven, method="hysim memory"), the(driven, method="exact step in C")
    close = [row for row in driven if row["tool"] not in ("hysim", "C", "C, Runge-Kutta 4") and row["error"] <= 1e-3]
    oscillator = [row for row in where(result["rows"], problem="oscillator") if row["error"] <= 1e-6]
    others = [row for row in oscillator if not row["method"].startswith("hysim") and row["method"] != "split in C"]
    fastest, second = (min(rows, key=lambda row: row["times_hysim"]) for rows in (close, others))
    (scheme,) = (row for row in result["ratios"] if row["what"] == "oscillator: hysim over the same scheme in C")
    missed = [row["what"] for row in result["ratios"] if "reached" in row and not row["reached"]]
    return [
        f"At n = 1 the law is {error_of(own['error'])} of the range wrong. The fastest package with an error of at "
        f"most 1e-3 is {fastest['method']} ({fastest['setting']}): it takes {number(fastest['times_hysim'])} times as "
        f"long. The same exact step in C takes {number(in_c['times_hysim'])} times as long.",
        f"On the oscillator the fastest package with an error of at most 1e-6 is {second['method']} "
        f"({second['setting']}): it takes {number(second['times_hysim'])} times as long. hysim takes "
        f"{number(scheme['median'])} times as long as its own scheme in C.",
        f"Ratios that were asked for and not reached: {'; '.join(missed)}." if missed else "Every ratio was reached.",
    ]


def batch(result: Result) -> list[str]:
    """Samples a second of many laws."""
    rows = where(result["rows"], kind="rows")
    names = {
        "1": "n = 1",
        "2": "n = 2",
        "1.5": "n = 1.5",
        "64 values": "64 values of n",
        "all differ": "all n different",
    }
    speeds = [(names[row["n"]], number(row["million_samples_per_second"])) for row in rows]
    slopes = result["slopes"].values()
    require(max(slopes) < 1.05, "the cost grows at most in proportion")
    return [
        f"A batch takes {span(column(rows, 'times_exp'), 2)} times as long as `np.exp` on as many numbers.",
        tabled(
            (f"{count(rows[0]['sets'])} laws, {rows[0]['samples']} samples, all cores", "million samples a second"),
            *speeds,
        ),
        f"The cost grows at most in proportion to samples and laws (powers of {span(slopes, 2)}).",
    ]


def cold_start(result: Result) -> list[str]:
    """The first call, compiled, from a wheel and from the cache."""
    rows = result["rows"]
    kinds = {name: column(rows, name) for name in ("compiled", "from a wheel", "from the cache")}
    seconds = [(name, number(median(each), 2), number(max(each), 2)) for name, each in kinds.items()]
    return [
        tabled((f"first of {len(rows)} calls [s of processor time]", "median", "worst"), *seconds),
    ]


def more_samples(result: Result) -> list[str]:
    """The invariant that more samples on a branch change nothing."""
    rows = result["rows"]
    families = list(dict.fromkeys(row["family"] for row in rows))
    ends = ("escaped", "undecided", "refused", "partly_refused")
    left_out = {row["family"]: sum(row[end] for end in ends) / row["cases"] for row in rows}
    worst = max(rows, key=lambda row: sum(row[end] for end in ends) / row["cases"])
    share = 100.0 * max(left_out[name] for name in left_out)
    share = max(share, 100.0 * sum(worst[end] for end in ends) / worst["cases"])
    return [
        f"In {count(result['cases_per_family'])} random hostile cases of each of {len(families)} families, in paths, "
        f"batches, compiled steps and inverses, {count(result['cases'])} comparisons, {result['violations']} violate "
        f"the invariant; the largest difference is {number(max(column(rows, 'worst')), 2)} of what is allowed.",
        f"At worst, for `{worst['family']}`, {percent(share)} of the cases are compared in part only or not at all, "
        "since a law diverges in all samplings or a step is refused.",
    ]


def wear_and_pinching(result: Result) -> list[str]:
    """Backward Euler beside the integrated law."""
    rows = where(result["rows"], law="worn and pinched")
    euler = [(str(row["steps"]), f"{number(row['backward_euler_percent'], 2)} %") for row in rows]
    return [
        tabled(("steps a cycle, on a spring that wears off and pinches", "error of backward Euler"), *euler),
        "OpenSees uses backward Euler. The law differs from itself with half the steps by at most "
        f"{error_of(max(column(result['rows'], 'law_percent')))} % of the memory's range. Euler's step is "
        "repeated here, not run in OpenSees.",
    ]


# Identification ------------------------------------------------------------------------------------------------------


def benchmark_bouc_wen(result: Result) -> list[str]:
    """The public benchmark, told and not told how it was made."""
    black = min(result["published"], key=lambda row: row["multisine"])
    errors, name = result["white_box"]["error_percent"], result["white_box"]["method"]
    worst = max(errors, key=errors.__getitem__)
    own = [
        f"{line['method'].removeprefix('hysim, ')}: the largest test errors over the seeds are "
        f"{error_of(line['multisine'])} m (multisine) and {error_of(line['sweep'])} m (sweep); the target is reached "
        f"by the tests in {line['tests_reached']:.0f} and by all parameters in {line['parameters_reached']:.0f} of "
        f"{line['seeds']:.0f} seeds (by chance {line['chance']:.2f} of the seeds reach it for the parameters)."
        for line in result["summary"]
    ]
    return [
        " ".join(own),
        "hysim is told the true equation and, unless a row says otherwise, how the records were made. The best "
        f"published black box, which is told neither, has an error of {error_of(black['multisine'])} m "
        f"({black['method']}).",
        f"A published fit of the same equation ({name}) is {number(errors[worst])} % off in {worst}, hysim with n "
        f"known {number(result['summary'][0][f'{worst}_error_percent'], 2)} %.",
    ]


def transfer_functions(result: Result) -> list[str]:
    """A stiff plant beside the bound of Cramer and Rao."""
    noisy = [row for row in result["rows"] if row["snr"] is not None]
    parts = []
    for row in noisy:
        fits = result["fits"][f"{row['snr']:g}"]
        gap = abs(row["median_fit"] - row["bound_median_fit"])
        require(gap < 0.25 * (100.0 - row["bound_median_fit"]), "the median fit is near the bound")
        parts.append(
            f"At SNR {row['snr']:g} the median fit to the clean output is {percent(row['median_fit'], 2)}, where the "
            f"bound of Cramer and Rao allows {percent(row['bound_median_fit'], 2)}, and the worst of {row['draws']} "
            f"draws {percent(min(fits), 2)}; {row['blocks_as_asked']} of {row['blocks']} blocks of draws have a "
            f"median of the {row['asked_fit']:g} % that was asked for."
        )
    return [*parts, "The numbers of poles and zeros are told."]


def table1_models(result: Result) -> list[str]:
    """Which model the 52 points prefer."""
    rows = result["rows"]
    best = the(rows, model=result["preferred"])
    least = min((row for row in rows if row["loo_rmse"] is not None), key=lambda row: row["loo_rmse"])
    require(best["bic"] == min(column(rows, "bic")), "the preferred model has the lowest BIC")
    plain, line = the(rows, model="bouc-wen"), the(rows, model="line")

    def said(row: Row) -> str:
        return (
            f"{percent(row['fit_percent'], 2)} with {row['parameters']} parameters, leave-one-out rmse "
            f"{1e3 * row['loo_rmse']:.1f} nm"
        )

    return [
        f"By BIC {best['model']}: {said(best)}, largest residual {best['largest_residual_pixels']:.2f} pixels. The "
        f"least leave-one-out rmse has {least['model']}: {said(least)}. The plain Bouc-Wen law has {said(plain)}; a "
        f"line {said(line)}.",
        f"{len(result['close']) - 1} other variants of {len(rows)} models have a BIC within 6 of the lowest and are "
        "hardly told from it. All were tried on the same points; experiment 33 repeats the search without the point "
        "that it predicts.",
    ]


def recovery(result: Result) -> list[str]:
    """Coverage of 95 % intervals."""
    rows = where(result["rows"], records=400)

    def held(kind: str, noisy: bool) -> str:
        cells = [row for row in where(rows, kind=kind) if (row["noise_in_quanta"] > 0.0) == noisy]
        return span(column(cells, "coverage_percent"), 3, " %")

    levels = sorted({row["noise_in_quanta"] for row in rows} - {0.0})
    missing = min(rows, key=lambda row: row["with_interval"])
    return [
        f"Over the parameters, profile intervals at 95 % hold the truth in {held('profile', True)} of 400 records "
        f"with noise of {listed([f'{level:g}' for level in levels])} quanta, and in {held('profile', False)} with "
        f"rounding alone, where they are too wide; the linear ones of least squares in {held('linear', True)} and "
        f"{held('linear', False)}.",
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
        f"{1e3 * best['loo_rmse']:.1f} nm; by BIC it would be {result['preferred_by_bic']}.",
        f"By signed ranks {len(undecided)} of the {len(rows) - 1} others cannot be told from it on these points, up "
        f"to {last['model']} with {1e3 * last['loo_rmse']:.1f} nm: so few points decide little. Each family has one "
        "form here; experiment 08 varies that of the Bouc-Wen laws.",
    ]


_NESTED = (("Bouc-Wen", "free"), ("linear plant, 4 poles", "rest"), ("line", ""))


def nested_table1(result: Result) -> list[str]:
    """Left-out errors with the whole search repeated."""
    rows = [row for row in result["rows"] if not row["terms_kept"]]
    found = the(rows, model="discovered", start="auto")
    best = min(rows, key=lambda row: row["left_out_rmse_um"])
    near = [row for row in rows if row["behind_in_stderr"] < 1.0]
    families = listed(list(dict.fromkeys(row["model"].split(",")[0] for row in near)))

    def off(row: Row) -> str:
        return f"{1e3 * row['left_out_rmse_um']:.1f} nm (at worst {1e3 * row['largest_left_out_um']:.0f} nm)"

    others = [the(rows, model=name, start=start) for name, start in _NESTED]
    named = [f"{row['model']} {off(row)}" for row in others]
    return [
        f"Left out one at a time, the least error has {best['model']} ({best['start']}), {off(best)}. The discovered "
        f"law, with the same terms in {found['same_structure']} of {found['folds']} searches, is off by "
        f"{off(found)}; {listed(named)}.",
        f"{len(near)} of {len(rows)} rows ({families}) lie within one standard error of the least: the points do not "
        "tell which of these predicts better.",
    ]


def simulated_twins(result: Result) -> list[str]:
    """Default calls of `identify` against the truth and SciPy."""
    devices = result["devices"]
    missed = {name: each for name, each in devices.items() if each["reached_percent"] < 100.0}
    slowest = max(devices, key=lambda name: devices[name]["worst_seconds"])
    sentences = [
        f"On {count(result['cases'])} records of {len(devices)} kinds of device the default call of `identify` reaches "
        f"the best sum of squares known to 1 % in {percent(result['reached_percent'])} of cases; "
        "`scipy.optimize.least_squares` from up to 20 random starts, in ten times the time and on the same compiled "
        f"laws, beats it by more in {percent(result['beaten_by_scipy_percent'])}.",
        f"It takes {result['median_seconds']:.2f} s in the median and {result['worst_seconds']:.0f} s at worst "
        f"({slowest}).",
    ]
    if missed:
        named = [f"{name} ({percent(each['reached_percent'], 0)} reached)" for name, each in missed.items()]
        sentences.append(
            f"Missed: {listed(named)}; at worst the sum of squares is {number(result['worst_over_best_known'])} times "
            "the best known."
        )
    return sentences


def measured_records(result: Result) -> list[str]:
    """Default calls of `identify` on measured records against SciPy and other seeds."""
    slowest = max(result["rows"], key=lambda row: float(row["seconds"]))
    sentences = [
        f"On {count(result['records'])} public measured records, in {count(result['cases'])} cases of a record and a "
        "family that suits it, the default call of `identify` reaches the best sum of squares known to 1 % in "
        f"{percent(result['reached_percent'])}; `scipy.optimize.least_squares` from up to 20 random starts on the same "
        "compiled laws, in ten times the time and at most "
        f"{number(result['longest_scipy_seconds'])} s (which ended it in {percent(result['shortened_scipy_percent'])} "
        f"of cases), beats it by more in {percent(result['beaten_by_scipy_percent'])}.",
        f"It takes {result['median_seconds']:.2f} s of processor time in the median and {result['worst_seconds']:.0f} "
        f"s at worst ({slowest['family']} on {slowest['record']}, {count(slowest['samples'])} samples); "
        f"{count(result['not_converged'])} of the calls said that the search did not converge.",
    ]
    named = [
        f"{each['family']} on {each['record']} ({number(each['over_best_known'])} times)" for each in result["lost"]
    ]
    remarks = [f"lost, with the sum of squares over the best known: {listed(named)}"] if named else []
    if result["cases_left_out"]:
        remarks.append(
            f"{count(result['cases_left_out'])} further cases are not run yet, among them the slowest, on "
            f"{listed(result['records_left_out'])}"
        )
    if remarks:
        sentences.append(f"Still open: {'; '.join(remarks)}.")
    return sentences


def identified_frame(result: Result) -> list[str]:
    """A frame identified from two earthquakes, and its drifts in a third."""
    require(result["converged"] == result["seeds"], "every search converges")
    require(result["median_peak_drift_error_percent"] < 2.0, "peak drifts within 2 % in the median")
    name = result["worst_law_parameter"]
    return [
        "From floor accelerations of two synthetic earthquakes with noise of 2 % of their peak, and a start that is "
        f"50 % off in each of {len(result['parameters'])} numbers, the largest drifts of a third earthquake are "
        f"predicted to {error_of(result['median_peak_drift_error_percent'])} % in the median of "
        f"{count(result['seeds'])} seeds and three storeys, and to "
        f"{error_of(result['worst_peak_drift_error_percent'])} % at worst; the start is off by "
        f"{number(result['median_peak_drift_error_of_start_percent'], 2)} % in its worst storey.",
        f"The damping is off by {error_of(result['median_damping_error_percent'])} % of itself (worst "
        f"{error_of(result['worst_damping_error_percent'])} %), its standard error is "
        f"{error_of(result['median_damping_stderr_percent'])} %, and its largest correlation with a number of the laws "
        f"{result['median_correlation_of_damping']:.2f} in the median (worst "
        f"{result['worst_correlation_of_damping']:.2f}): damping and yielding are told apart. "
        f"The numbers of the laws are off by {error_of(result['median_law_error_percent'])} % in the median and "
        f"{error_of(result['worst_law_error_percent'])} % at worst (`{name}`); all errors are "
        f"{result['rms_error_in_stderr']:.2f} standard errors in the rms.",
        f"A search takes {number(result['median_seconds'], 2)} s in the median and "
        f"{number(result['worst_seconds'], 2)} s at worst, on two cores; the masses, the form of the law and the "
        "motion of the ground are told.",
    ]


# Discovery -----------------------------------------------------------------------------------------------------------


def sindy_recovery(result: Result) -> list[str]:
    """How often the true structure is found, beside PySINDy."""
    own, peer = (
        {row["condition"]: row for row in where(result["rows"], method=method)} for method in ("hysim", "PySINDy")
    )
    seeds, hidden = result["seeds"], "y = 40 u + 60 z"
    short = [name for name in own if ", noise" in name and not name.endswith("noise 0%")]
    exact, theirs = (sum(rows[name]["exact"] for name in short) for rows in (own, peer))
    unlikely = sum(seeds - own[name]["as_likely"] for name in short)
    loud, loud_peer = own["noise 10%"], peer["noise 10%"]
    losses = [
        f"{name} ({peer[name]['exact']} against {own[name]['exact']})"
        for name in own
        if own[name]["exact"] < peer[name]["exact"]
    ]
    worst = max((row for row in own.values() if row["worst_error_percent"]), key=lambda row: row["worst_error_percent"])
    return [
        f"On short records of two rates with noise the structure is exact in {exact} of {seeds * len(short)} (PySINDy: "
        f"{theirs}). In {unlikely} of the {seeds * len(short) - exact} misses the data themselves prefer the wrong "
        "law.",
        f"With the memory measured and 10 % noise it is exact in {loud['exact']} of {seeds} seeds (PySINDy: "
        f"{loud_peer['exact']}); with the memory hidden in {hidden}, in {own[hidden]['exact']} (PySINDy: "
        f"{peer[hidden]['exact']}). PySINDy is ahead at: {', '.join(losses) or 'no condition'}.",
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
        f"A law of {len(result['terms'])} terms and {own['n_parameters']} parameters fits "
        f"{percent(own['fit_percent'], 2)} (BIC {own['bic']:.1f}). The best fit of the Bouc-Wen laws is "
        f"{percent(fit['fit_percent'], 2)} ({fit['model']}, {fit['n_parameters']} parameters), their lowest BIC "
        f"{bic['bic']:.1f} ({bic['model']}).",
        f"{count(result['draws'])} records are drawn anew from the law: {len(often)} of its terms are found again in "
        f"at least {100 * min(often):.0f} % of the draws, and the last one in {100 * seldom:.0f} %. The verdict is "
        f'"{result["verdict"]}".',
    ]


def sindy_benchmark(result: Result) -> list[str]:
    """The benchmark's law from input and output alone."""
    rows = result["rows"]

    def said(case: str) -> str:
        cells = where(rows, case=case)
        worst = max(max(row["multisine"], row["sweep"]) for row in cells)
        return (
            f"the three right terms and no other in {sum(row['right_terms'] for row in cells)} of {len(cells)} "
            f"seeds, no coefficient more than {number(max(column(cells, 'worst_percent')), 2)} % off, test errors of "
            f"at most {error_of(worst)} m"
        )

    peers = column(where(rows, case="plain PySINDy, m, c, k given"), "worst_percent")
    clean = the(rows, case="plain PySINDy, m, c, k given, clean")["worst_percent"]
    library = the(rows, case="benchmark", seed=1)["library"]
    return [
        f"Of {library} terms, told how the records were made: {said('benchmark')}. Not told: "
        f"{said('benchmark, recipe not told')}. That the plant is a mass on a spring with memory is told in both.",
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
    published, lag = result["published_widths"], result["lag_widths"]
    return [
        f"A published sparse model of a piezo loop is a linear lag: its loop is {100 * published[1]:.1f} % of the "
        f"stroke wide at 1 Hz and {100 * published[0]:.1f} % at 0.1 Hz, which a pole and a zero give exactly, and "
        f"{100 * published[2]:.1f} % at 10 Hz, where they give {100 * lag[2]:.1f} %.",
        f'Under one rate all {len(single)} records, lag and Bouc-Wen law, are called "{single[0]["verdict"]}"; under '
        f"two "
        f'the lag is called "{double["published lag"]}" and the law "{double["Bouc-Wen"]}".',
    ]


_WRONG = (
    ("called hysteresis", "a curve or a linear system is called hysteresis"),
    ("hysteresis lost", "hysteresis is not found"),
    ("cannot tell at two rates", "two rates are called one"),
)


def adversarial_records(result: Result) -> list[str]:
    """Verdicts on records that are made to mislead."""
    sets = result["sets"]
    seen, held_back = sets["seen"], sets["held back"]
    wrong = [f"{words} in {sum(part[kind] for part in sets.values())}" for kind, words in _WRONG]
    return [
        f"Of {seen['records']} records that were looked at while the limits were chosen {seen['right']} are right, "
        f"of {held_back['records']} that were held back {held_back['right']}: {listed(wrong)}.",
        f"The median record takes {max(part['median_cpu_seconds'] for part in sets.values()):.1f} s of processor "
        f"time, the slowest {max(part['largest_cpu_seconds'] for part in sets.values()):.1f} s. The second set has "
        "other numbers, but the same kinds of record.",
    ]


# Control -------------------------------------------------------------------------------------------------------------


def lag_of_equation_1(result: Result) -> list[str]:
    """What a PID takes of the lag of equation (1), against robustness."""
    rows = sorted(result["rows"], key=lambda row: row["bound"])
    worst = "least_of_the_searches_percent"  # in results of several searches for each bound
    several = all(worst in row for row in rows)
    reached = [
        f"{row['bound']:g}: {percent(row['lag_reduction_percent'], 0)}"
        + (f" ({percent(row[worst], 0)})" if several else "")
        for row in rows
    ]
    enough = [row["bound"] for row in rows if row["lag_reduction_percent"] >= 90.0]
    require(not enough or min(enough) > 2.0, "90 % need more than the usual bound")
    needed = f"need a bound of {min(enough):g}" if enough else f"are not reached at {rows[-1]['bound']:g}"
    return [
        "The paper's equation (1) has lag and no hysteresis. The best PID of a global search takes away, by the "
        "bound on the maximum sensitivity (commonly at most "
        f"2){', in brackets the worst search' if several else ''}: {', '.join(reached)}.",
        f"The paper's 90 % {needed}. The plant is known exactly, nothing disturbs it, and the figures hold for this "
        "triangle and sampling.",
    ]


_DAMPED = "model-following, damped"


def _beside(rows: Sequence[Row]) -> str:
    """A sentence on what the reductions of some loops are worth."""
    require(all(row["stable"] for row in rows), "all loops are stable")
    limited, jump = (max(column(rows, name)) for name in ("limited_percent", "volts_per_pixel"))
    return (
        f"All loops are stable, at a limit of the voltage in at most {percent(limited)} of the samples; one more "
        f"sample of delay raises their maximum sensitivity to at most {number(max(column(rows, _DELAYED)))}, and a "
        f"pixel of the paper's camera would move their commands by up to {number(jump)} V."
    )


_DELAYED = "max_sensitivity_with_delay"


def compensation_matrix(result: Result) -> list[str]:
    """What each part of a controller adds."""
    rows = {row["controller"]: row for row in result["rows"]}
    held, with_n, normalised = result["parameters_within_5_percent"]
    names = "PID", "inverse + creep inverse", "model-following"

    def off(name: str, draws: Row) -> list[str]:
        return [name, *(percent(draws[key]) for key in ("median", "fifth_percentile", "worst_corner"))]

    widths = [f"{name} {percent(rows[name]['hysteresis_reduction_percent'])}" for name in names]
    key, worst = "residual_rms_reduction_percent", "worst_residual_rms_reduction_percent"
    shaken = [(name, percent(rows[name][key]), percent(rows[name][worst])) for name in (*names, _DAMPED)]
    return [
        "Where the controller knows the actuator exactly, the hysteresis reduction of a triangle of 1 Hz is "
        f"{listed(widths)}.",
        tabled(("reduction of the residual vibration after a step", "mode known", "mode 10 % off"), *shaken),
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
    simple = [the(rows, controller=name) for name in ("PID", "inverse + creep inverse", "model-following")]
    others = [f"{row['controller']} {percent(row[f'{kept}_p5'])}" for row in simple]
    ahead, sudden = (best[f"residual_rms_reduction_percent{kind}_p5"] for kind in ("_known_ahead", ""))
    return [
        f"Law, creep and mode are each up to {result['spread_percent']:g} % off. Model-following with damping, a broad "
        f"notch and an extra-insensitive shaper removes {percent(best[f'{kept}_p50'])} of the hysteresis in the "
        f"median, and {percent(best[f'{kept}_p5'])} in the 5th percentile of {best['draws']} draws.",
        f"It removes {percent(ahead)} of the residual vibration in the 5th percentile for a step known ahead, and "
        f"{percent(sudden)} for a sudden one. Unstable draws: {best['unstable']}.",
        f"Simpler controllers remove in the 5th percentile of {simple[0]['draws']} draws: {'; '.join(others)}. The "
        "gains of the robust rows were chosen by hand on other draws.",
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
        f"Through whole pixels of {result['pixel_um']:g} um the inverse of law and creep, without feedback and with "
        f"the law known exactly, takes {percent(best[true])} of the true hysteresis away, and the pixels show "
        f"{percent(best[measured])}.",
        f"Feedback on pixels makes it worse: {span(column(fed_back, true), 3, ' %')} with the inverse. A fast PID "
        f"alone, whose command moves by {number(pid['volts_per_pixel'])} V for a pixel, is in a limit cycle on the "
        "pixels, stable as it is in linear theory. The camera is taken to be as fast as the controller.",
    ]


def rate_sweep(result: Result) -> list[str]:
    """Up to which rate compensation holds."""
    rows, key = result["rows"], "hysteresis_reduction_percent"
    rates = (1.0, 10.0, 100.0)

    def at(name: str) -> list[str]:
        return [name, *(percent(the(rows, controller=name, frequency_hz=rate)[key]) for rate in rates)]

    follow = where(rows, controller="model-following")
    worst = min(follow, key=lambda row: row[key])
    return [
        tabled(
            ("reduction of the loop's width", *(f"{rate:g} Hz" for rate in rates)),
            *map(at, ("model-following", "inverse + creep inverse", "PID")),
        ),
        f"Model-following reduces it least at {worst['frequency_hz']:g} Hz, by {percent(worst[key])}.",
        "Every controller knows the actuator exactly; experiment 15 says what becomes of that when it does not.",
    ]


def pid_hysteresis(result: Result) -> list[str]:
    """What a PID leaves."""
    rows = where(result["rows"], plant="law, creep, mode")
    usual = where(rows, max_sensitivity=2.0)
    robust = where(rows, max_sensitivity=min(column(rows, "max_sensitivity")))

    def by_rate(cells: Iterable[Row]) -> str:
        return listed(
            [f"{percent(row['hysteresis_reduction_percent'])} at {row['frequency_hz']:g} Hz" for row in cells]
        )

    ended = column(result["rows"], "search_finished")
    search = (
        f"The search for the gains ended by its tolerance in {sum(ended)} of {len(ended)} rows."
        if ended
        else "The search for the gains was cut off after a fixed number of trials, and they may not be the best ones."
    )
    least = min(column(where(result["rows"], max_sensitivity=2.0), "lag_share_percent"))
    return [
        f"On law, creep and mode a PID within a maximum sensitivity of 2 takes {by_rate(usual)} away; within "
        f"{robust[0]['max_sensitivity']:g}, {by_rate(robust)} (a negative reduction is a wider loop).",
        f"At 2, at least {percent(least, 0)} of the width that is left would be there without hysteresis: lag; with "
        f"one sample more of delay the sensitivity is {number(max(column(usual, _DELAYED)))}, and a pixel of the "
        f"paper's camera would move the command by {number(max(column(usual, 'volts_per_pixel')))} V. {search}",
    ]


def vibration(result: Result) -> list[str]:
    """Vibration after a step, by its size."""
    key = "residual_rms_reduction_percent"
    steps = where(result["rows"], plant="Table 1", controller="model-following")
    robust = where(result["rows"], plant="Table 1", controller="robust, EI")
    sizes = [f"{percent(row[key])} after {row['step_um']:g} um" for row in steps]
    limited = [f"{row['step_um']:g} um" for row in steps if row["limited_samples"]]
    four, six = (where(result["rows"], plant=name, controller="PID") for name in ("(4)", "(6)"))
    names = "overshoot_reduction_percent", key, "settling_time_reduction_percent"
    figures = [listed([span(column(rows, name), 3) for name in names]) for rows in (four, six)]
    return [
        f"On Table 1's actuator, known exactly, model-following takes of the residual vibration {listed(sizes)} "
        f"away; the voltage is limited at {listed(limited)}. The robust controller of experiment 15 takes "
        f"{span(column(robust, key), 3)} %.",
        f"Overshoot, residual and settling time on the paper's plant (4) are reduced by {figures[0]} % by PID, on "
        f"(6) by {figures[1]} %: plants that are known exactly, without noise.",
    ]


def closed_loop_speed(result: Result) -> list[str]:
    """One loop here and elsewhere."""
    own, *peers = where(result["rows"], kind="loop")
    by_name = {row["name"]: row["times_hysim"] for row in peers}
    blocks = by_name["python-control alone"] / by_name["python-control, one compiled block"]
    require(blocks > 2.0, "most of python-control's time is spent on joining blocks")
    times = [f"{name} {number(ratio)} times" for name, ratio in sorted(by_name.items(), key=lambda each: each[1])]
    return [
        f"A sample takes {number(own['microseconds_per_sample'], 2)} us in `close_loop`. Elsewhere the same loop takes "
        f"as many times as long: {'; '.join(times)}. All displacements agree to "
        f"{error_of(max(column(peers, 'largest_difference_um')))} um.",
        "In python-control most of the time is spent on joining blocks, not on the law: one block is "
        f"{number(blocks, 2)} times faster than the same loop joined from blocks.",
    ]


# Other families ------------------------------------------------------------------------------------------------------


def extended_plays(result: Result) -> list[str]:
    """What extensions do to a Prandtl-Ishlinskii loop."""
    rows = {row["law"]: row for row in result["rows"]}
    plain, dead, two = (rows[name] for name in ("plain", "dead zones", "two envelopes"))
    fast, slow = rows["speed 0.1"], rows["speed 0.05"]
    return [
        f"Dead zones make the loop uneven by {percent(100 * dead['odd_within'], 0)} of the stroke, two envelopes by "
        f"{percent(100 * two['odd_within'], 0)}; the width in the middle, {number(plain['mid_width'])} in the plain "
        f"law, becomes {number(two['mid_width'])} with two envelopes, and {number(slow['mid_width'])} and "
        f"{number(fast['mid_width'])} as the speed doubles.",
        f"Each inverse undoes its law to {error_of(max(column(result['rows'], 'inverse_error')))} of the stroke at "
        "worst.",
    ]


def preisach(result: Result) -> list[str]:
    """Preisach laws from reversal curves."""
    few, many = min(result["rows"], key=_curves), max(result["rows"], key=_curves)
    chosen = result["smoothness"]
    seconds, over = ([each[name] for each in chosen] for name in ("seconds", "over_best_strength"))
    worst = max(chosen, key=lambda each: float(each["over_best_strength"]))
    return [
        f"On a random input that it has not seen, a law from {few['curves']} to {many['curves']} reversal curves "
        f"with {100 * result['noise']:g} % of noise is {number(few['read_error_percent'], 2)} to "
        f"{number(many['read_error_percent'], 2)} % wrong where the table is read from them, "
        f"{number(few['fitted_error_percent'], 2)} to {number(many['fitted_error_percent'], 2)} % where it is fitted, "
        f"and {number(few['smooth_error_percent'], 2)} to {number(many['smooth_error_percent'], 2)} % where its "
        "density is smooth.",
        "The truth is a bank of relays with a smooth density: a case that suits all three.",
        f"On {len(chosen)} random densities, from triangles of four sizes, the smoothness that the default chooses in "
        f"{number(median(seconds), 2)} s ({number(max(seconds), 2)} s at worst) is {median(over):.2f} times as wrong "
        "as the best one would be in the median, more than 1.15 times for "
        f"{sum(each > 1.15 for each in over)} of them, and {worst['over_best_strength']:.2f} times at worst, for a "
        f"ridge {worst['width']:.2f} wide with {100 * worst['noise']:g} % of noise.",
    ]


def _curves(row: Row) -> float:
    return float(row["curves"])


def dashpot(result: Result) -> list[str]:
    """A damper with and without its dashpot."""
    names = dict.fromkeys(row["model"] for row in result["rows"])
    worst = {name: max(column(where(result["rows"], model=name), "error_percent")) for name in names}
    rates = column(result["rows"], "rate_hz")
    errors = [f"{name} at most {number(value, 2)} %" for name, value in worst.items()]
    return [
        f"Identified at {result['fitted_at_hz']:g} Hz with {100 * result['noise']:g} % of noise and asked for the "
        f"force at {min(rates):g} to {max(rates):g} Hz, the models are off by: {', '.join(errors)} of the range.",
        "The last one has the form of the truth, which is told.",
    ]


def friction(result: Result) -> list[str]:
    """LuGre against general solvers."""
    alone, mass = (where(result["rows"], problem=name) for name in ("law alone", "pulled mass"))
    own = where(alone, method="hysim")
    solvers = [row for row in alone if row["method"] in ("DOP853", "Radau", "LSODA")]
    fixed = [row for row in alone if row["method"].startswith("Runge-Kutta")]
    lost = [row["sigma0"] for row in fixed if row["error"] is None]
    stiffnesses = column(own, "sigma0")
    require(all(row["turns"] == 0 for row in own), "stiff bristles do not chatter")
    ours = the(mass, method="hysim", setting=result["own_tolerance_of_times"])
    finest = min(row["setting"] for row in mass if row["method"] != "hysim")
    theirs = [
        f"{row['method']} at {row['setting']:g} {number(row['times_hysim'], 2)} times that for an error of "
        f"{error_of(row['error'])}"
        for row in mass
        if row["method"] != "hysim" and row["setting"] == finest
    ]
    return [
        f"Along a given motion hysim's force is within {error_of(max(column(own, 'error')))} of the breakaway force of "
        f"the closed form at every stiffness from {min(stiffnesses):g} to {max(stiffnesses):g} N/m, "
        f"without a turn that should not be, and takes {number(result['ns_per_sample_of_long_records'], 2)} ns a "
        f"sample of a long record. SciPy's solvers at {result['tolerance']:g} are within "
        f"{error_of(max(column(solvers, 'error')))}, and take {number(min(column(solvers, 'times_hysim')), 2)} to "
        f"{number(max(column(solvers, 'times_hysim')), 2)} times as long on a record of {result['n_samples']} samples, "
        f"where calling costs hysim the most; a loop of fixed steps loses the motion from {min(lost):g} N/m on.",
        f"A mass that sticks and slips takes {number(ours['ns_per_sample'] / 1000, 2)} us a sample in a structure for "
        f"an error of {error_of(ours['error'])}: {listed(theirs)}.",
        "On one mass with one contact a general stiff solver is therefore as good: the tolerance of a structure is a "
        "share of the largest drift, and bristles bend over a small part of it.",
    ]


# Studies and files ---------------------------------------------------------------------------------------------------


def sweep_study(result: Result) -> list[str]:
    """On which parameter a loop depends most."""
    parts = []
    for measure in ("width", "area"):
        ranked = sorted(where(result["rows"], measure=measure), key=lambda row: -abs(row["rank_correlation"]))
        first, *others = [f"{row['parameter']} ({row['rank_correlation']:.2f})" for row in ranked]
        parts.append(f"the {measure} on {first}, less on {listed(others)}")
    return [f"By rank correlation over {count(result['n_tasks'])} laws: {'; '.join(parts)}."]


def kill_and_resume(result: Result) -> list[str]:
    """A study that is killed and resumed."""
    rows = result["rows"]
    again = max(column(rows, "computed_twice"))
    require(all(row["in_time"] for row in rows), "every kill came while the study ran")
    return [
        f"A study of {result['n_tasks']} tasks is killed at {len(rows)} random moments and resumed. "
        f"{result['columns_that_differ']} columns of its table differ from the uninterrupted one's, but for the "
        "seconds.",
        f"In all, {again:.0f} tasks that were on their way were computed again.",
    ]


def scaling(result: Result) -> list[str]:
    """What a sweep costs beside its tasks."""
    rows = where(result["rows"], workers=2)

    def shared(kind: str) -> str:
        values = {row["executor"]: row["efficiency_percent"] for row in where(rows, kind=kind)}
        return listed([f"{name} {percent(value, 0)}" for name, value in values.items()])

    short = the(rows, kind="microsecond", executor="threads", tasks=100_000)
    one, other = (the(rows, kind=f"laws on Table 1, n = {n}") for n in ("1", "1.5"))
    limit = result["workers_at_saturation"]
    return [
        f"The efficiency of two workers is, on tasks of 10 ms in a kernel, {shared('10 ms in a kernel')}; on tasks "
        f"of 10 ms with large arrays, {shared('10 ms with arrays')}; on fits, {shared('fit')}.",
        f"A task of less than a microsecond costs {number(short['overhead_microseconds'], 2)} us on threads; a "
        f"million laws on the paper's points take {number(one['seconds'], 2)} s with n = 1 and "
        f"{number(other['seconds'], 2)} s with n = 1.5.",
        f"A model that is fitted to these rows lets a dask cluster saturate at {number(limit['0.01 s'], 2)} workers "
        f"with tasks of 10 ms and at {number(limit['1 s'], 2)} with tasks of 1 s; it is not tried on a larger "
        "cluster.",
    ]


def fuzz(result: Result) -> list[str]:
    """Damaged inputs to the command line."""
    kinds = listed(list(dict.fromkeys(f"{row['damaged']}" for row in result["rows"])))
    require(
        result["inputs"] == sum(result[end] for end in ("exit 0", "exit 1", "exit 2")), "every run ends in 0, 1 or 2"
    )
    return [
        f"Of {count(result['inputs'])} damaged inputs ({kinds}), each handed to a command, {result['broken']} end in "
        f"a traceback, in more than one line of error or with a file half written; {count(result['exit 0'])} are "
        f"accepted, {count(result['exit 1'] + result['exit 2'])} refused.",
    ]


# Camera --------------------------------------------------------------------------------------------------------------


def registration(result: Result) -> list[str]:
    """Displacement from frames, beside scikit-image."""
    rows = result["rows"]
    pictures = len({row["picture"] for row in rows})

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
    memory = column(speed, "peak_mib")
    return [
        f"The errors are those on {pictures} kinds of picture that were not used while developing, and of the better "
        "setting of scikit-image.",
        tabled(("rms error [pixels]: median (worst)", *(f"{snr} dB" for snr in levels)), *map(ends, ("hysim", peer))),
        f"Whole pixels are off by {number(max(at('whole pixels', 30)), 2)} pixels.",
        f"The bias is at most {number(bias, 2)} pixels at 20 dB and better; the error is {span(honest, 2)} times its "
        f"own standard error. {min(column(speed, 'frames_per_second')):.0f} frames of 512 x 512 pixels a second of "
        f"one core, with {span(memory)} MiB for {speed[0]['frames']} and {speed[-1]['frames']} frames.",
    ]


def virtual_rig(result: Result) -> list[str]:
    """What the camera of Table 1 costs."""
    lines = {line["measured"]: line for line in result["summary"]}
    fine, dim = lines["parts of a pixel"], lines["parts of a pixel, 20 dB"]
    whole, shaken = lines["whole pixels"], lines["whole pixels, shaken"]
    key, width = "hysteresis_reduction_percent", "width_error_percent"
    off = max(abs(line[width][end]) for line in (fine, dim) for end in ("least", "most"))
    best = result["true_law_reduction_percent"]
    repeated = whole[key]["least"] == whole[key]["most"]
    spread = "one result, repeated in every run" if repeated else f"{percent(whole[key]['least'])} at worst"
    return [
        f"A known actuator under a simulated microscope, {fine['tables']} times. With displacements to parts of a "
        f"pixel, the loop's width is within {number(off, 2)} % of the true one, and the inverse of the identified law "
        f"takes {percent(min(fine[key]['least'], dim[key]['least']))} of the true hysteresis away at worst, as that of "
        f"the true law ({percent(best)}). From whole pixels it takes {percent(whole[key]['median'])}, {spread}.",
        f"Where the microscope shakes as well, the median is {percent(shaken[key]['median'])}, the best "
        f"{percent(shaken[key]['most'])} and the worst {percent(shaken[key]['least'], 0)}, a loop "
        f"{number(1.0 - 0.01 * shaken[key]['least'], 2)} times as wide as without a controller. The width is then "
        f"{shaken[width]['least']:.0f} to {shaken[width]['most']:+.0f} % off, within its interval in "
        f"{shaken['width_covers']} of {shaken['tables']} runs. Family and form of the true law are told.",
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
        else f"Bouc-Wen with n = 1 is {count(int(board))} bytes of code on a Cortex-M7, without the C library, and "
        f"{count(int(result['cortex_m7_ram_bytes']))} bytes of state."
    )
    missing = f" Not run: {listed(result['not_run'])}." if result["not_run"] else ""
    units = sum(int(row[f"compared_{name}"]) for row in rows for name in ran if name.startswith("FMI"))
    ends = listed([f"{error_of(median(values))} and {error_of(max(values))} in {n}" for n, values in worst.items()])
    return [
        f"In {count(int(result['compared']))} comparisons of {len(rows)} families, inverses, plants and controllers "
        f"with Python's compiled step ({count(units)} of them in units, each family in part), the largest "
        "difference as a part of the range, median and worst of the families, "
        f"is {ends}; no sanitizer reports anything.{missing}",
        f"A sample takes {number(median(column(rows, 'ns_c')), 2)} ns in C in the median and "
        f"{number(slowest['ns_c_most'], 2)} ns at worst ({slowest['family']}); in a family's median numba's "
        f"pointer takes {span(gains, 2)} times as long; the inverse of Bouc-Wen with a general exponent takes "
        f"{number(result['general_inverse_ns'], 2)} ns in the median of its laws and "
        f"{number(result['general_inverse_ns_most'], 2)} ns at worst, "
        f"{number(result['general_inverse_ns_numba'], 2)} ns through numba's pointer.",
        on_board,
    ]


def controllers_in_c(result: Result) -> list[str]:
    """Tracking controllers in C on the measurements of their loops."""
    equal = sum(row["worst_difference"] == 0.0 for row in result["rows"])
    most = max(column(result["rows"], "at_limits_percent"))
    return [
        f"{count(result['laws'])} controllers, each with the inverse of another law, were replayed in C on the "
        f"{count(result['samples'])} measurements of their own loops. In {count(equal)} of them C has the bits of "
        f"Python, and the worst differs by {number(result['worst_difference'])} of the range. They are at the voltage "
        f"limits in {result['least_at_limits_percent']:.2g} to {most:.0f} % of the samples.",
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
        f"On {count(result['records'])} records, {count(result['measured'])} of them measured, at least "
        f"{result['verbs']} verbs report the same fit, to {number(result['largest_difference'], 1)} %.",
        f"On {count(result['noisy_twins'])} simulated records with noise of the input, the error of the returned model "
        f"is {number(result['over_floor_median'], 2)} times that of the true law with the best filter in the median "
        f"and {number(result['over_floor_worst'])} times at worst; 95 % intervals hold "
        f"{percent(result['held_percent'])} of {count(result['parameters'])} parameters.",
        f"The README's flow ran on {count(result['flows'])} records, without a command beyond the record that was not "
        f"warned of; on {count(result['flows_refused'])} more the law has no inverse there, and says so. C and Python "
        f"differ by at most {number(result['c_apart_worst'], 2)} of the span of the commands.",
    ]


def page_redraw(result: Result) -> list[str]:
    """Redraws of a page after a slider, beside Python and Matplotlib."""
    rows, promised = result["rows"], result["promised_ms"]
    medians = column(rows, "median_ms")
    ratios = [row["notebook_median_ms"] / row["median_ms"] for row in rows]
    slowest, last = max(rows, key=lambda row: row["median_ms"]), max(rows, key=lambda row: row["worst_ms"])
    require(max(medians) <= promised, "a redraw takes at most what is promised in the median")
    return [
        f"In a page, {len(rows)} models with {count(rows[0]['samples'])} samples are redrawn in "
        f"{span(medians, 2)} ms, each the median of up to {count(result['keys'])} slider steps "
        f"({slowest['model']} takes longest); the slowest single redraw takes {number(last['worst_ms'], 2)} ms "
        f"({last['model']}). The same law, measures and figure by Python and Matplotlib take {span(ratios, 2)} times "
        "as long. The browser's painting afterwards is not in these times.",
    ]


def structures_work_precision(result: Result) -> list[str]:
    """Frames in earthquakes beside OpenSees, SciPy and plain loops."""
    frame = where(result["rows"], problem="three storeys, n = 2")
    own = the(frame, setting="tolerance 1e-08")
    finest = [row for row in result["beside_opensees"] if row["opensees"].endswith("64 substeps")]
    (steel,) = (row for row in result["asked"] if row["what"] == "Steel01, same Newmark: difference of drifts")
    tower = the(result["rows"], problem="twenty storeys on isolators", setting="tolerance 1e-08")
    equal = [row for row in frame if row["error"] <= 1e-4]
    verlet = min(row["ns_per_term"] for row in equal if row["method"].startswith("Verlet"))
    ours, scipy = (min(row["ns_per_term"] for row in equal if row["tool"] == tool) for tool in ("hysim", "SciPy"))
    missed = [f"{row['what']} ({number(row['value'])})" for row in result["asked"] if not row["reached"]]
    require(
        min(row["times_more_exact"] for row in result["beside_opensees"]) > 1.0, "hysim is more exact at equal cost"
    )
    return [
        f"Three Bouc-Wen storeys at ductility 5: the drifts are {error_of(own['error'])} wrong at the default "
        f"tolerance. OpenSees with 64 steps a sample is {span(column(finest, 'error'), 2)} wrong; hysim with that "
        f"error is {span(column(finest, 'times_faster'), 2)} times faster.",
        f"To 1e-4 a sample and element takes {number(ours)} ns, the faster of SciPy's methods {number(scipy)} ns, and "
        f"a plain compiled Verlet loop around hysim's laws {number(verlet)} ns.",
        f"With the same Newmark steps OpenSees' Steel01 and hysim's law differ by {error_of(steel['value'])}. Twenty "
        f"storeys on isolators: drifts {error_of(tower['error'])} wrong. "
        + (
            f"Figures that were asked for and not reached: {'; '.join(missed)}."
            if missed
            else "All figures are reached."
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
        f"A gain that falls by 20 % is followed to {error_of(errors[0])} % rms in the median of {len(points)} seeds. "
        f"Recursive least squares with the best of six forgetting factors reaches {error_of(errors[1])} %; a drift of "
        f"wrong size, told by the user, {error_of(errors[2])} %.",
        f"On {len(walks)} records in which both walk, bands at 95 % contain the gain in {number(pooled[0], 3)} % of "
        f"the samples and the exponent in {number(pooled[1], 3)} %: the bands of the exponent are too narrow.",
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
    errors = listed([f"{row['input']} {error_of(row[unit])} (worst {error_of(row[worst])})" for row in usual])
    predictions = listed([f"{name} {error_of(value)}" for name, value in predicted.items()])
    return [
        f"On {designed['draws']} simulated stages the designed input has the smallest errors. In its expected standard "
        f"errors, the median error of a parameter is {error_of(designed[unit])} (worst {error_of(designed[worst])}); "
        f"with the usual inputs: {errors}.",
        f"For prediction the multisine is better. Errors on an unseen record in parts of the noise: {predictions}. The "
        "design was made for parameters that are 10 % off; family of the law, sharpness and memory are told.",
    ]


def channels(result: Result) -> list[str]:
    """Parameters that follow a supply or a temperature."""
    rows, simulated, measured = result["rows"], result["simulated"], result["measured"]
    damper = {row["model"]: row for row in where(rows, case="simulated damper, a supply left out")}
    stack = {row["model"]: row for row in where(rows, case="temperature along a record")}
    jointly, warm, cold = damper["in the supply"], stack["in the temperature"], stack["one law for the record"]
    others = [row for name, row in damper.items() if name != "in the supply"]
    require(all(row["median_error_percent"] > jointly["median_error_percent"] for row in others), "the channel is best")
    beside = "; ".join(f"{row['model']} {error_of(row['median_error_percent'])} %" for row in others)
    separate, joint = measured["rmse_of_a_law_each"], measured["rmse_in_the_supply"]
    squares = [sum(error**2 for error in errors) for errors in (joint, separate)]
    require(squares[0] <= 1.1**2 * squares[1], "one law in the supply fits nearly as well as a law for each")
    return [
        "A simulated damper is identified at four supplies and predicted at a fifth: the error is "
        f"{error_of(jointly['median_error_percent'])} % of the force's range in the median of {simulated['seeds']} "
        f"seeds ({error_of(jointly['worst_error_percent'])} % at worst). Without a channel: {beside}. "
        f"{number(jointly['intervals_that_hold_percent'])} % of the 95 % intervals contain the truth.",
        f"A stack whose temperature drifts is predicted at 40 degC to {error_of(warm['median_error_percent'])} %, by "
        f"one law for the record to {error_of(cold['median_error_percent'])} %.",
        f"On a measured damper at 0 V and 0.88 V one law in the supply is {number(joint[0])} N and {number(joint[1])} "
        f"N off, a law for each supply {number(separate[0])} N and {number(separate[1])} N. Outside that range it "
        f"fails: a third record would need {measured['supply_of_4_4']:.2f} V, and the law is "
        f"{number(measured['rmse_of_4_4'])} N off. Supplies, law and exponent of the simulated damper are told.",
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
        f"Of {len(ordered)} models, with the rounding to pixels as noise, and boxes of the priors halved, unchanged "
        f"and doubled: {result['sentence']}. Half boxes cut off the optimum of some models.",
        tabled(("model, with unchanged boxes", "ln Z, less that of the first"), *values),
        f"Errors of ln Z by bridge sampling are at most {error_of(result['largest_error'])}. "
        f"Nested sampling of {len(nested)} of them, with errors of {span(column(nested, 'error'), 2)}, differs by at "
        f"most {number(result['largest_difference_of_methods'], 2)} standard errors, and takes "
        f"{number(sum(column(nested, 'cpu_seconds')) / beside, 2)} times the processor time of bridge sampling.",
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
        f"{count(round(own['effective_samples']))} effective samples of the seven-parameter law on the paper's points, "
        f"whose posterior has three separate optima, take {number(own['cpu_seconds'])} s of processor time (R-hat at "
        f"most {own['rhat']:.3f}): {number(own['effective_per_second'] / plain['effective_per_second'])} times as many "
        "a second as emcee's own moves on a log-likelihood by hand with a loop over the walkers. In "
        f"{count(len(result['draws']))} draws of laws about it, intervals at 95 % hold the truth in "
        f"{result['pooled_percent']:.1f} % of the cases (standard error {result['standard_error_percent']:.1f} %; in "
        f"the two halves of the draws {first:.1f} and {second:.1f} %), in {result['least_percent']:.0f} to "
        f"{result['most_percent']:.0f} % by parameter; a draw takes {number(median(seconds))} s in the median and "
        f"{number(max(seconds))} s at worst.{_not_mixed(result)}",
    ]


def _not_mixed(result: Result) -> str:
    """A sentence on the draws whose steps did not suffice."""
    seeds = result["seeds_not_mixed"]
    if not seeds:
        return ""
    spans = span(result["draws"][seed]["span"] for seed in seeds)
    return (
        f" {len(seeds)} draws (seeds {', '.join(map(str, seeds))}) have fewer than {count(result['asked_effective'])} "
        f"effective samples after {count(result['most_steps'])} steps, and count all the same; without them it is "
        f"{result['pooled_percent_of_mixed']:.1f} %. Their outputs span {spans} µm."
    )


def structure_ensembles(result: Result) -> list[str]:
    """A million oscillators in an earthquake."""
    rows, grown = result["rows"], result["growth"]
    exact = [row for row in rows if str(row["method"]).startswith("hysim") and row["worst_error"] <= 1e-5]
    own = min(exact, key=lambda row: row["million_minutes"])
    loose, plain = the(rows, method="hysim, tolerance 0.001"), the(rows, method="Newmark, 8 steps a sample")
    coarse = the(rows, method="Newmark, 1 steps a sample")
    return [
        f"{count(own['sets'])} masses on Bouc-Wen springs under {count(own['samples'])} samples, on "
        f"{result['threads']} threads; a million would take {number(own['million_minutes'])} min at largest drifts "
        f"that are {error_of(own['median_error'])} wrong in the median and {error_of(own['worst_error'])} at worst of "
        f"{result['checked']}, and {number(loose['million_minutes'])} min at {error_of(loose['worst_error'])} at "
        f"worst. A compiled loop of Newmark's method takes {number(coarse['million_minutes'])} min at "
        f"{error_of(coarse['worst_error'])} and {number(plain['million_minutes'])} min at "
        f"{error_of(plain['worst_error'])} at worst. The time grows with number and length by powers of "
        f"{grown['power_of_number']:.2f} and {grown['power_of_length']:.2f}; four times as many take "
        f"{grown['further_memory_mb']:.0f} MB more memory.",
    ]


def jiles_atherton(result: Result) -> list[str]:
    """How exact the law of magnetic cores is."""
    digits, there, back = result["digits"], *(result["invariant"][way] for way in ("forwards", "inverse"))
    rows, trip = result["rows"], result["round_trip"]
    coarse, fine = (where(rows, method="Runge-Kutta 4", steps=steps) for steps in (200, 2_000))
    euler, many = (where(rows, method="Euler", steps=steps) for steps in (200, 2_000))
    own = [row for row in rows if row["method"] == "hysim"]
    require(there["violations"] == back["violations"] == 0, "more samples on a branch change nothing")
    others = result["spellings"]["errors"]
    return [
        f"{count(digits['laws'])} laws are {error_of(digits['median'])} of the range wrong in the median and "
        f"{error_of(digits['worst'])} at worst, against dM/dH integrated with 30 digits. More samples on a branch "
        f"change none of {count(there['cases'])} hostile laws, and none of the inverses of as many, by more than 1e-11 "
        "of the range and the roundings; the largest difference is "
        f"{number(max(there['worst_share'], back['worst_share']), 2)} of that "
        f"({count(there['jumping'])} of the laws jump, in one step and in many); driven by B, "
        f"{count(trip['laws'])} laws return it to {error_of(trip['worst'])} of the range at worst.",
        f"With 200 and 2 000 steps a stroke Runge and Kutta's rule over H is {span(column(coarse, 'error'), 2)} and "
        f"{span(column(fine, 'error'), 2)} wrong and takes {span(column(coarse + fine, 'times_hysim'), 2)} of hysim's "
        f"time a sample, Euler's {span(column(euler, 'error'), 2)} and {span(column(many, 'error'), 2)} at "
        f"{span(column(euler + many, 'times_hysim'), 2)}; hysim has the same output with one step a stroke, to "
        f"{error_of(max(column(own, 'error')))} of the range.",
        f"The equations of {listed(list(others))}, each with its own constants and "
        f"{count(result['spellings']['steps'])} steps of Runge and Kutta's rule a stroke, differ from hysim's law by "
        f"{span(others.values(), 2)} of the range.",
    ]


def magnetic_loops(result: Result) -> list[str]:
    """Measured loops of cores by seven families, and Jiles-Atherton fits beside an evolution."""
    rows, sets = result["rows"], result["sets"]
    own, evolved = (where(rows, law=f"Jiles-Atherton{name}") for name in ("", ", differential evolution"))
    exactly = [each["default_over_evolution_exactly"] for each in sets.values()]
    require(max(exactly) <= 1.001, "no evolution finds a better law")
    require(max(each["default_over_refined"] for each in sets.values()) <= 1.01, "the default finds the best optimum")
    better = {name: each["default_over_evolution"] for name, each in sets.items()}
    lost = {name: ratio for name, ratio in better.items() if ratio > 1.001}
    named = listed([f"{name} ({number(ratio)})" for name, ratio in lost.items()]) if lost else "no material"
    predicted = sorted(
        (row for row in rows if row["left_out_percent"] is not None), key=lambda row: row["left_out_percent"]
    )
    errors = []
    for name in dict.fromkeys(row["set"] for row in rows if row["law"] == "Tellinen"):
        each = sorted(
            (row for row in where(rows, set=name) if row not in evolved), key=lambda row: row["worst_error_percent"]
        )
        errors.append(f"{name} {_each_error(each, 'worst_error_percent')}")
    return [
        f"On {len(sets)} sets of measured loops a default call for `hs.JilesAtherton` takes "
        f"{span(column(own, 'cpu_seconds'), 2)} s of the processor. Its sum of squares is {span(better.values(), 3)} "
        f"times that of a differential evolution on a law by hand in {span(column(evolved, 'cpu_seconds'), 2)} s. It "
        f"is larger on {named}, where the evolution fits by the error of its 200 steps a branch: with the law "
        f"integrated exactly, the default's is {span(exactly, 3)} times that of the evolution's constants.",
        "Errors of the worst amplitude in percent of its range, all amplitudes by one set of constants: "
        f"{'; '.join(errors)}.",
        "Errors on the ferrite's middle amplitude, left out and predicted: "
        f"{_each_error(predicted, 'left_out_percent')}.",
    ]


def _each_error(rows: Iterable[Row], name: str) -> str:
    return listed([f"{row['law']} {number(row[name], 2)}" for row in rows])


def whole_actuator(result: Result) -> list[str]:
    """Law, creep, mode and delay of simulated stages, at once."""
    rows = {row["model"]: row for row in result["rows"]}
    whole, cascade, alone = (rows[name] for name in ("whole actuator", "law >> transfer function", "law alone"))
    require(whole["worst_error_in_noise"] < 1.5, "every prediction is within 1.5 times the noise")
    require(whole["converged"] == whole["draws"], "every search converged")
    share = result["intervals_that_hold_percent"]
    require(share >= 90.0, "the intervals hold")
    parts = {
        name.removesuffix(".percent"): each for name, each in result["intervals_that_hold_percent_by_part"].items()
    }
    by_part = ", ".join(
        f"{part.rpartition('.')[2].replace('_', ' ')} {number(value)} %" for part, value in parts.items()
    )
    beside = "; ".join(
        f"{name} to {number(row['median_error_in_noise'], 2)} times (worst {number(row['worst_error_in_noise'], 2)}, "
        f"{row['draws']} draws)"
        for name, row in (("the law alone", alone), ("the law and a transfer function", cascade))
    )
    return [
        f"Of {whole['draws']} simulated stages a sine of a rate and amplitude that no record holds is predicted to "
        f"{number(whole['median_error_in_noise'], 2)} times the noise of the sensor in the median and "
        f"{number(whole['worst_error_in_noise'], 2)} times at worst; by {beside}.",
        f"{number(share, 3)} % of {result['intervals']} intervals at 95 % hold the truth ({by_part}); the family of "
        f"the law, the creep's bank and the number of modes were told, and the stages are of the models searched.",
        f"A fit takes {number(whole['median_cpu_seconds'], 2)} s of processor time in the median and "
        f"{number(whole['worst_cpu_seconds'], 2)} s at worst, the law alone "
        f"{number(alone['median_cpu_seconds'], 2)} s, and the law and a transfer function, from one record, "
        f"{number(cascade['median_cpu_seconds'], 2)} s.",
    ]


def mirror(result: Result) -> list[str]:
    """Laws of three piezos before common modes, and lines in their place, on a mirror that was measured."""
    rows, tests = result["rows"], [f"test_{level}_percent" for level in (100, 200, 300)]
    outputs = list(dict.fromkeys(row["output"] for row in rows))
    names = [name for name in dict.fromkeys(row["model"] for row in rows) if " at " not in name]
    errors = {name: [[the(rows, model=name, output=output)[test] for test in tests] for output in outputs]
              for name in names}  # fmt: skip
    require(all(row["success"] for row in rows), "every search converged")
    each = "; ".join(f"{name} {' and '.join(_three(error) for error in errors[name])}" for name in names)
    ratios = {
        name: [[law / line for law, line in zip(*pair, strict=True)] for pair in zip(own, errors["lines"], strict=True)]
        for name, own in errors.items() if name != "lines"
    }  # fmt: skip
    outer = [ratio for own in ratios.values() for levels in own for ratio in (levels[0], levels[2])]
    between = [levels[1] for own in ratios.values() for levels in own]
    shifts, crossed = [], []
    for output in outputs:
        low, high = (result["frequencies_hz"][f"{output}, lines at {level} mV"] for level in (100, 300))
        shifts += [100.0 * (b / a - 1.0) for a, b in zip(low[:4], high[:4], strict=True)]
        own, other = (
            the(rows, output=output, model=f"lines at {level} mV")["test_300_percent"] for level in (300, 100)
        )
        crossed.append(f"{number(other)} in place of {number(own)} %")
    told = len(next(iter(result["frequencies_hz"].values())))
    published = result["published_percent"]
    return [
        f"On three piezos of a measured mirror, {' and '.join(outputs)} on a realisation that was left out, at 100, "
        f"200 and 300 mV, in percent of the standard deviation: {each}. It is a subset of the published test, whose "
        f"baselines are {_three(published['linear'])} for one linear model and {_three(published['nonlinear'])} for a "
        "nonlinear one.",
        f"Laws before the modes ({listed(list(ratios))}) have {span(outer, 3)} times the error of lines at the two "
        f"levels that were learnt, and {span(between, 3)} times at the level between; the search was told where "
        f"{told} modes begin, and takes {span(column(rows, 'cpu_seconds'), 2)} s of processor time.",
        "What they lack is in the modes: identified at one level alone, lines leave at 300 mV "
        f"{' and '.join(crossed)}, and the four lowest frequencies lie {span([-shift for shift in shifts], 2)} % "
        "lower at 300 mV than at 100.",
    ]


def _three(errors: Iterable[float]) -> str:
    return "/".join(number(each) for each in errors)


GROUPS: dict[str, tuple[Finding, ...]] = {
    "Evaluation and speed": (
        exact_step,
        work_precision,
        structures_work_precision,
        structure_ensembles,
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
        pixel_sensor,
        rate_sweep,
        pid_hysteresis,
        vibration,
        closed_loop_speed,
        tracking,
    ),
    "Other families": (extended_plays, preisach, dashpot, friction),
    "Studies and files": (sweep_study, kill_and_resume, scaling, fuzz),
    "Camera": (registration, virtual_rig),
    "Outside Python": (one_law_everywhere, controllers_in_c, page_redraw),
}
