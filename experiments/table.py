"""Write `experiments/README.md` and the table of the README, from the stored results.

    python experiments/table.py           writes both
    python experiments/table.py --check   names each difference, and exits with 1 if there is one

The questions are the first sentences of the experiments, the answers come from `findings.py`. Nothing is computed
anew but the sentences: to change a number, run its experiment.
"""

import ast
import difflib
import json
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TypeVar

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

from findings import GROUPS, Finding, Result  # noqa: E402  from beside this file
from headlines import HEADLINES  # noqa: E402

T = TypeVar("T")

PAGE, README = HERE / "README.md", HERE.parent / "README.md"
BEGIN, END = "<!-- experiments/table.py writes what follows -->\n", "<!-- to here -->\n"

HEAD = """\
# Experiments

Each file asks one question of hysim through its public functions, and answers it with a table, a figure and numbers in
`results/`. The findings below are computed from these numbers by `python experiments/table.py`; `--check` names every
sentence that no longer agrees with its result. Where hysim was told something that a user would not know, the finding
says so, and it gives the bad end of a distribution as well as the median.

```shell
pip install -e '.[test,bench,vision,dask,tables,io]'  # bench: the peers of 03, 39; vision: 29, 30; dask: 28
pip install -e '.[dev,export]'                        # 37, which also looks for gcc and clang
python experiments/01_exact_step.py                   # measures, prints, and writes results/exact_step
python experiments/10_sindy_recovery.py resume        # 10 and 33: only what is not stored yet
python experiments/32_more_samples.py --chunks work   # keeps finished chunks in the folder work
python -m pytest tests/test_experiments.py -k smoke   # smoke mode: every experiment in seconds, nothing is written
```

From Python, `main(smoke=True)` of an experiment is its smoke mode. Times are those of one machine and one run; where
two are compared, they were measured in turns.
"""


def experiments() -> dict[str, Path]:
    """The experiments by the names of their results."""
    return {path.stem.split("_", 1)[1]: path for path in sorted(HERE.glob("[0-9]*.py"))}


def question(path: Path) -> str:
    """The first sentence of an experiment, which ends with a question mark; `ValueError` if it is not a question."""
    text = " ".join((ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or "").split("\n\n")[0].split())
    if "?" not in text:
        raise ValueError(f"{path.name} begins with no question: {text!r}")
    return text[: text.index("?") + 1]


def stored(sentences: Callable[[Result], T]) -> T:
    """What a finding or a headline says of its stored result; `ValueError` if the result does not support it."""
    path = HERE / "results" / sentences.__name__ / "result.json"
    try:
        return sentences(json.loads(path.read_text(encoding="utf-8")))
    except (KeyError, OSError, ValueError) as error:
        raise ValueError(f"{sentences.__name__}: {type(error).__name__}: {error}") from error


def section(finding: Finding, path: Path) -> str:
    """An experiment: its script and its question, its figure and its numbers, and a line for each sentence found."""
    folder = f"results/{finding.__name__}"
    head = f"### [{path.stem[:2]}]({path.name}) {question(path)}\n"
    links = f"[Figure]({folder}/figure.svg), [table]({folder}/table.csv)."
    return "\n".join([head, links, *stored(finding)]).rstrip() + "\n"


def page() -> str:
    """The page of all experiments; `ValueError` if one has no finding, or a finding no experiment."""
    paths = experiments()
    named = [finding.__name__ for group in GROUPS.values() for finding in group]
    if sorted(named) != sorted(paths):
        raise ValueError(f"experiments and findings differ: {sorted(set(named) ^ set(paths))}")
    index = [f"| [{path.stem[:2]}]({path.name}) | {question(path)} |" for path in paths.values()]
    parts = [HEAD, "\n".join(["| | question |", "|---|---|", *index, ""])]
    for title, group in GROUPS.items():
        parts += [f"## {title}\n", *(section(finding, paths[finding.__name__]) for finding in group)]
    return "\n".join(parts)


def quoted() -> str:
    """The table of the README."""
    paths = experiments()
    lines = ["| question | hysim | the alternative | where hysim is not good |", "|---|---|---|---|"]
    for headline in HEADLINES:
        question, *cells = stored(headline)
        lines.append(f"| [{question}](experiments/{paths[headline.__name__].name}) | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def readme(text: str) -> str:
    """The README with what it quotes written anew."""
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    if not after:
        raise ValueError(f"README.md needs the lines {BEGIN.strip()!r} and {END.strip()!r}")
    return f"{before}{BEGIN}\n{quoted()}\n{END}{after}"


def differences(name: str, written: str, computed: str) -> Iterator[str]:
    """The sentences in which a text differs from the computed one, each with the line where it stands."""
    before, after = written.splitlines(), computed.splitlines()
    place, places = "text", []
    for line in after:
        script = re.match(r"### \[\d\d\]\((\w+)\.py\)", line)
        place = script[1] if script else "text" if line.startswith("## ") else place
        places.append(place)
    for kind, a, b, c, d in difflib.SequenceMatcher(None, before, after, autojunk=False).get_opcodes():
        if kind == "equal":
            continue
        place = ", ".join(dict.fromkeys(places[c:d])) or "text"
        old, new = (re.split(r"(?<=[.?:;]) ", " ".join(lines)) for lines in (before[a:b], after[c:d]))
        for line in difflib.ndiff(old, new):
            if line.startswith(("- ", "+ ")):
                yield f"{name}, {place}: {'written ' if line[0] == '-' else 'computed'}: {line[2:]}"


def documents() -> dict[Path, str]:
    """The text that each generated document has to have."""
    return {PAGE: page(), README: readme(README.read_text(encoding="utf-8"))}


def check() -> list[str]:
    """Every difference between the documents and the results; none if all is well."""
    try:
        texts = documents()
    except ValueError as error:
        return [str(error)]
    return [
        line
        for path, computed in texts.items()
        for line in differences(
            str(path.relative_to(HERE.parent)),
            path.read_text(encoding="utf-8") if path.exists() else "",
            computed,
        )
    ]


def main(arguments: list[str]) -> int:
    """Write the documents, or compare them; the exit code."""
    if arguments not in ([], ["--check"]):
        print(f"expected nothing or --check, got {' '.join(arguments)}", file=sys.stderr)
        return 2
    if not arguments:
        for path, text in documents().items():
            path.write_text(text, encoding="utf-8")
        return 0
    found = check()
    print("\n".join(found) or "every quoted number agrees with its result")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
