"""Does anything that is given to the command line end otherwise than in an exit code and at most one line of error?

Damaged files of every format, damaged models, damaged studies and random options are given to every command, in one
process, each from a seed of its own. A run is broken if it ends in a traceback, writes more than one line of error or
any result beside an error, exits with another code than 0, 1 or 2, or leaves a file that nobody asked for, half of one,
or any at all where it exits with 2, but for the rows of a study, which are kept. Options that start processes or ask
for a network are left out, and so are fits that take seconds: the records have five samples.
"""

import contextlib
import io
import itertools
import os
import random
import re
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from unittest import mock

import hysim as hs
from hysim.cli import Command
from hysim.cli import main as hysim_command
from hysim.cli.options import Parameter
from hysim.models.storage import to_json
from hysim.plot import Figure

sys.path.insert(0, str(Path(__file__).parent))
from malformed_files import corrupt
from results_folder import one_panel, write_results

RESULTS = Path(__file__).parent / "results" / "fuzz"
N_CASES, N_SMOKE = 10_000, 100
SAMPLES = "t [s],u [V],y [um]\n0,0,0.0\n1,1,0.5\n2,2,1.5\n3,1,1.0\n4,0,0.2\n"
STUDY = """seed = 1
[response]
law = "law.json"
record = "loop.csv"
u = "u"
y = "y"
measure = "rmse"
[grid]
beta = [0.2, 0.5]
n = {from = 1.0, to = 2.0, number = 3}
"""
LAW = hs.BoucWen(gain=0.5, feedthrough=1.0)
MODELS = {
    "law": LAW,
    "lag": hs.TransferFunction(num=(1.0,), den=(1.0, 1.0)),
    "line": hs.Line(slope=2.0),
    "chain": hs.Actuator(hysteresis=LAW, vibration=hs.mode(2.0, 0.5), sensor=hs.Sensor(noise=0.1)),
    "pid": hs.PID(kp=1.0),
}
FILES = {"loop.csv": SAMPLES, "study.toml": STUDY} | {f"{name}.json": to_json(made) for name, made in MODELS.items()}

COLUMNS = ("--u", "u", "--y", "y")
USUAL: dict[str, tuple[str, ...]] = {
    "metrics": ("FILE", *COLUMNS),
    "identify": ("FILE", *COLUMNS, "--model", "line"),
    "discover": ("FILE", *COLUMNS),
    "compare": ("FILE", *COLUMNS, "--model", "line", "--model", "MODEL"),
    "simulate": ("MODEL", "FILE", "--u", "u"),
    "control": ("MODEL", "--sample-time", "0.1", "--range", "1,2", "--controller", "inverse"),
    "plot": ("FILE", *COLUMNS, "--model", "MODEL", "--out", "out.svg"),
    "sweep": ("STUDY", "--out", "rows.sqlite"),
    "reproduce": (),
}
COMMANDS = ("metrics",) * 6 + ("simulate",) * 6 + ("identify", "discover", "compare", "control") * 2 + (
    "plot", "sweep", "sweep", "reproduce", "",
)  # fmt: skip
NO_REPRODUCTION = ("--out loop.csv/in/the/way", "--out loop.csv", "--out", "--quick again", "--jsn", "loop.csv")
LEFT_OUT = ("--help", "--version", "--processes", "--dask", "--intervals", "--quick")
PATHS = ("out.json", "out.svg", "out.png", "out.pdf", "out.csv", "out.c", "none/out.json", "-", ".", "", "a\0b")
WORDS = (
    "", "0", "1", "3", "-1", "2.5", "0.1", "nan", "inf", "1e999", "x", "u", "t", "y", "0,1", "1,0", "1,2", "3,0.5", ",",
    "n=1", "beta=0:1", "n=", "=", "u=V", "beta", "a\0b", "../x", "line", "bouc-wen", "lag.json", "loop.csv", "é", ";",
    "loo", "cycles", "detect", "\x1b[31m", "a\nb", "tab", "utf-16", "step", "{}", "--", "-", "0x10", "1_000",
)  # fmt: skip
TOKENS = ("nan", "1e999", "-1", "0", "null", "[]", "{}", '"x"', "true", "3", "1e300", "", '"law.json"', "'")
NUMBER = re.compile(r"-?\b\d+(\.\d+)?\b")
NUMBERS = ("0", "-1.0", "0.5", "2", "3.5", "1e300", "-1e-300", "1e999")
ENDS = ("exit 0", "exit 1", "exit 2", "broken")

Row = dict[str, float | str]


def case(seed: int) -> tuple[str, list[str], dict[str, bytes]]:
    """What is damaged, the arguments, and the files beside them."""
    rng = random.Random(seed)
    command = rng.choice(COMMANDS)
    files = {name: text.encode() for name, text in FILES.items()}
    names = {"FILE": "loop.csv", "MODEL": f"{rng.choice(sorted(MODELS))}.json", "STUDY": "study.toml"}
    taken = [name for name in names if name in USUAL.get(command, ())]
    damaged = rng.choice([*taken, *taken, "options"])
    if damaged == "FILE":
        names["FILE"], content = corrupt(seed)
        files[names["FILE"]] = content
    elif damaged != "options":
        files[names[damaged]] = changed(files[names[damaged]].decode(), rng)
    arguments = [command] if command else [rng.choice(("metric", "x", "", "--x", "--version"))]
    arguments += [names.get(word, word) for word in USUAL.get(command, ())]
    if command == "reproduce":
        arguments += rng.choice(NO_REPRODUCTION).split()
    elif damaged == "options" and command:
        arguments = with_options(command, arguments, rng)
    return {"FILE": "record", "MODEL": "model", "STUDY": "study"}.get(damaged, damaged), arguments, files


def with_options(command: str, arguments: list[str], rng: random.Random) -> list[str]:
    """The arguments with some options more, and sometimes one word less."""
    options = [each for each in Command(command).declared if each.title != "Arguments"]
    known = [option for option in options if option.click.opts[0] not in LEFT_OUT]
    for option in rng.sample(known, min(len(known), rng.choice((0, 1, 1, 2, 3)))):
        arguments.append(option.click.opts[0])
        if option.value.name:
            arguments.append(value(option, rng))
    if rng.random() < 0.2:
        del arguments[rng.randrange(1, len(arguments))]
    return arguments


def value(option: Parameter, rng: random.Random) -> str:
    """What may be given to an option: one of its words, a path, or a word that fits or does not."""
    if option.value.words and rng.random() < 0.8:
        return rng.choice(option.value.words)
    return rng.choice(PATHS if option.value.role else WORDS)


def changed(text: str, rng: random.Random) -> bytes:
    """A model or a study with another number in it, or with tokens replaced, cut, or with bytes that are no text."""
    if rng.random() < 0.5:
        first, last = rng.choice([place.span() for place in NUMBER.finditer(text)])
        return (text[:first] + rng.choice(NUMBERS) + text[last:]).encode()
    pieces = text.split()
    for _ in range(rng.choice((1, 1, 2, 5))):
        at = rng.randrange(len(pieces))
        pieces[at] = rng.choice((rng.choice(TOKENS), rng.choice(TOKENS) + ",", rng.choice(pieces), pieces[at][:-1]))
    separator = "\n" if text.startswith("seed") else " "
    content = separator.join(pieces).encode()
    if rng.random() < 0.2:
        content = content[: rng.randrange(len(content) + 1)]
    return content + b"\xff" if rng.random() < 0.05 else content


def outcome(arguments: list[str], files: dict[str, bytes]) -> tuple[str, str]:
    """How a run ends, one of `ENDS`, and what is wrong with it."""
    out, err = io.StringIO(), io.StringIO()
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder), warnings.catch_warnings():
        warnings.simplefilter("always")
        for name, content in files.items():
            Path(name).write_bytes(content)
        with (
            contextlib.redirect_stdout(out),
            contextlib.redirect_stderr(err),
            mock.patch("sys.stdin", io.TextIOWrapper(io.BytesIO(b"u,y\n0,1\n1,\n"))),
        ):
            try:
                code = hysim_command(arguments)
            except SystemExit as exit_:
                code = exit_.code
            except BaseException:  # whatever it is, it is what is looked for
                return "broken", traceback.format_exc()
        there = {path.name: path.read_bytes() for path in Path().rglob("*") if path.is_file()}
    return ends(code, out.getvalue(), err.getvalue(), files, there, arguments)


def ends(
    code: object, out: str, err: str, before: dict[str, bytes], after: dict[str, bytes], arguments: list[str]
) -> tuple[str, str]:
    """Whether exit code, output, errors and files go together."""
    new = set(after) - set(before)
    if arguments[0] == "sweep":  # finished rows are kept, whatever comes after them
        new -= {word for option, word in itertools.pairwise(arguments) if option == "--out"}
    wrong = [f"exit code {code!r}"] if code not in (0, 1, 2) else []
    if code == 2:
        wrong += [f"errors of {err.count(chr(10))} lines: {err}"] if err.count("\n") != 1 else []
        wrong += [f"output beside an error: {out[:200]}"] if out else []
        wrong += [f"files are left: {sorted(new)}"] if new else []
        wrong += ["a file has changed"] if {name: after.get(name) for name in before} != before else []
    else:
        wrong += [f"words beside a result: {err}"] if err else []
        asked = {Path(word).stem for word in arguments if word}
        wrong += [f"nobody asked for {name}" for name in new if Path(name).stem not in asked]
    return ("broken", "; ".join(wrong)) if wrong else (f"exit {code}", "")


def fuzzed(n_cases: int) -> Iterator[tuple[str, str, str, str, float]]:
    """Of each case: what was damaged, the command, how it ended, what is wrong, and the seconds it took."""
    for seed in range(n_cases):
        damaged, arguments, files = case(seed)
        began = time.perf_counter()
        end, wrong = outcome(arguments, files)
        if wrong:
            print(f"seed {seed}: hysim {' '.join(map(repr, arguments))}\n{wrong}")
        command = arguments[0] if arguments[0] in USUAL else "no command"
        yield damaged, command, end, wrong, time.perf_counter() - began


def main(smoke: bool = False) -> list[Row]:
    """Fuzz, print and write table, figure and result."""
    with mock.patch.dict(os.environ, {"COLUMNS": "120"}):
        found = list(fuzzed(N_SMOKE if smoke else N_CASES))
    counts = Counter((damaged, command, end) for damaged, command, end, _, _ in found)
    rows: list[Row] = [
        {"damaged": damaged, "command": command, **{end: counts[damaged, command, end] for end in ENDS}}
        for damaged, command in sorted({(damaged, command) for damaged, command, *_ in found})
    ]
    for row in rows:
        print("  ".join(f"{name} {value}" for name, value in row.items()))
    total = Counter(end for _, _, end, _, _ in found)
    seconds = [taken for *_, taken in found]
    print(f"{len(found)} inputs: {dict(total)}; {sum(seconds):.1f} s, the slowest {max(seconds):.2f} s")
    if smoke:
        if total["broken"]:
            raise RuntimeError(f"{total['broken']} of {len(found)} inputs are broken")
    else:
        write_results(RESULTS, rows, draw, {"inputs": len(found), **{end: total[end] for end in ENDS}})
    return rows


def draw(rows: list[Row]) -> Figure:
    """Inputs by command, and how they end."""
    canvas, ax = one_panel(3.6)
    commands = sorted({str(row["command"]) for row in rows}, reverse=True)
    left = [0.0] * len(commands)
    for end, shade in zip(ENDS, ("#0072B2", "#56B4E9", "#dddddd", "#D55E00"), strict=True):
        numbers = [sum(float(row[end]) for row in rows if row["command"] == command) for command in commands]
        ax.barh(commands, numbers, left=left, label=end, color=shade, edgecolor="#555555", linewidth=0.4)
        left = [a + b for a, b in zip(left, numbers, strict=True)]
    ax.set_xlabel("Inputs")
    ax.grid(visible=False, axis="y")
    ax.legend(ncols=len(ENDS), loc="lower center", bbox_to_anchor=(0.45, 1.0))
    return canvas


if __name__ == "__main__":
    main()
