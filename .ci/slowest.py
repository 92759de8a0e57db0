"""Which tests take long? CPU seconds of all of them, by what tests/circles.toml says of them.

    python .ci/slowest.py [pytest's arguments]

The suite runs twice, first to compile. The second circle should hold the tests of more than MOST CPU s a case, or of
MOST_IN_ALL in all cases; what it lacks, and what it could give back, is printed.
"""

import subprocess
import sys
import tempfile
import tomllib
import xml.etree.ElementTree as ET
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).parent.parent
MOST, MOST_IN_ALL = 2.0, 5.0


def measured(arguments: list[str]) -> dict[str, list[float]]:
    """CPU seconds of the cases of each test."""
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.xml"
        command = [sys.executable, "-m", "pytest", "-n", "2", "-m", "", f"--junitxml={report}", *arguments]
        for _ in range(2):
            subprocess.run(command, cwd=ROOT, stdout=subprocess.DEVNULL)
        seconds = defaultdict(list)
        for case in ET.parse(report).iter("testcase"):
            *folders, file = case.get("classname", "").split(".")
            path = f"{file}.py" if folders == ["tests"] else "/".join([*folders, f"{file}.py"])
            test = f"{path}::{case.get('name', '').partition('[')[0]}"
            seconds[test] += [
                float(each.get("value", 0.0)) for each in case.iter("property") if each.get("name") == "cpu"
            ]
    return seconds


def main() -> None:
    seconds = measured(sys.argv[1:])
    circles = tomllib.loads((ROOT / "tests" / "circles.toml").read_text())
    purposes = {name: purpose for purpose, names in circles.items() for name in names}
    sums: dict[str, float] = defaultdict(float)
    for name, cases in sorted(seconds.items(), key=lambda each: -sum(each[1])):
        purpose = purposes.get(name, "first circle")
        sums[purpose] += sum(cases)
        is_slow = max(cases, default=0.0) > MOST or sum(cases) > MOST_IN_ALL
        if is_slow != (name in purposes):
            print(
                f"{sum(cases):6.1f} in {len(cases):3} cases, at most {max(cases, default=0.0):5.1f}  {purpose}: {name}"
            )
    for purpose, total in sums.items():
        print(f"{total:6.1f} CPU s  {purpose}")


if __name__ == "__main__":
    main()
