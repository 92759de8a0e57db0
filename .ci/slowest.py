"""Which tests take long, and what would the first circle miss without them?

    python .ci/slowest.py [pytest's arguments]             CPU seconds of all tests, by what tests/circles.toml says
    python .ci/slowest.py --coverage [pytest's arguments]  lines of hysim/ that each circle runs (needs pytest-cov)

For the seconds the suite runs twice, first to compile. The second circle should hold the tests of more than MOST CPU s
a case or MOST_IN_ALL in all cases; what it lacks, and what it could give back, is printed. A line counts for the first
circle if one of its tests or an import runs it; tests that need extras count for the second one. Kernels are left out
of the total: both circles run them compiled, which no measurement of lines sees, and a few tests of the second one
uncompiled.
"""

import os
import subprocess
import sys
import tempfile
import tomllib
import xml.etree.ElementTree as ET
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
MOST, MOST_IN_ALL = 0.7, 2.0
SUITE = [sys.executable, "-m", "pytest", "-n", "2", "-m", ""]


def purposes() -> dict[str, str]:
    """The purpose of each test of the second circle."""
    circles = tomllib.loads((ROOT / "tests" / "circles.toml").read_text())
    return {name: purpose for purpose, names in circles.items() for name in names}


def measured(arguments: Sequence[str]) -> dict[str, list[float]]:
    """CPU seconds of the cases of each test."""
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.xml"
        for _ in range(2):
            subprocess.run([*SUITE, f"--junitxml={report}", *arguments], cwd=ROOT, stdout=subprocess.DEVNULL)
        seconds = defaultdict(list)
        for case in ET.parse(report).iter("testcase"):
            *folders, file = case.get("classname", "").split(".")
            path = f"{file}.py" if folders == ["tests"] else "/".join([*folders, f"{file}.py"])
            test = f"{path}::{case.get('name', '').partition('[')[0]}"
            seconds[test] += [
                float(each.get("value", 0.0)) for each in case.iter("property") if each.get("name") == "cpu"
            ]
    return seconds


def print_seconds(arguments: Sequence[str]) -> None:
    """What the circles take, and which tests stand in the wrong one."""
    seconds, purpose_of = measured(arguments), purposes()
    sums: dict[str, float] = defaultdict(float)
    for name, cases in sorted(seconds.items(), key=lambda each: -sum(each[1])):
        purpose = purpose_of.get(name, "first circle")
        sums[purpose] += sum(cases)
        is_slow = max(cases, default=0.0) > MOST or sum(cases) > MOST_IN_ALL
        if is_slow != (name in purpose_of):
            print(
                f"{sum(cases):6.1f} in {len(cases):3} cases, at most {max(cases, default=0.0):5.1f}  {purpose}: {name}"
            )
    for purpose, total in sums.items():
        print(f"{total:6.1f} CPU s  {purpose}")


def covered(circle: str, arguments: Sequence[str]) -> dict[str, set[int]]:
    """Lines of each file of hysim/ that the tests with the markers of a `circle` run."""
    from coverage import CoverageData

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "coverage"
        command = [*SUITE[:-1], circle, "--cov=hysim", "--cov-report=", *arguments]
        subprocess.run(command, cwd=ROOT, stdout=subprocess.DEVNULL, env={**os.environ, "COVERAGE_FILE": str(file)})
        data = CoverageData(str(file))
        data.read()
        return {path: set(data.lines(path) or ()) for path in data.measured_files()}


def print_coverage(arguments: Sequence[str]) -> None:
    """Lines of each room that the whole suite runs, and the share of them that the first circle runs."""
    second_circle = " or ".join([*tomllib.loads((ROOT / "tests" / "circles.toml").read_text()), "extra"])
    first, second = (covered(circle, arguments) for circle in (f"not ({second_circle})", second_circle))
    lines: dict[str, list[int]] = defaultdict(lambda: [0, 0])
    for path in first.keys() | second.keys():
        room, own = Path(path).relative_to(ROOT / "hysim").parts[0], first.get(path, set())
        for name in [room] if room == "kernels" else ["total", room]:
            lines[name][0] += len(own | second.get(path, set()))
            lines[name][1] += len(own)
    for name, (whole, part) in sorted(lines.items(), key=lambda each: each[1][1] / max(each[1][0], 1)):
        print(f"{100.0 * part / max(whole, 1):6.2f} % of {whole:6} lines  {name}")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--coverage"]:
        print_coverage(sys.argv[2:])
    else:
        print_seconds(sys.argv[1:])
