"""How long is the package? Lines of code and of docstrings, folder by folder.

    python .ci/count_lines.py               every folder of hysim/, their total less PARTS_APART, tests, experiments
    python .ci/count_lines.py hysim/models  every file of one folder
    python .ci/count_lines.py --most        exit status 1 above a limit of limits.toml, or where one has been raised

A line of code holds a token that is no comment, of a statement that is no docstring; blank lines do not count. Stubs
(`*.pyi`) count as code.
"""

import argparse
import ast
import io
import subprocess
import sys
import tokenize
import tomllib
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LIMITS = ".ci/limits.toml"
PARTS_APART = ("paper", "vision", "rig")  # what the package is used for here, not the package
NO_CODE = {
    tokenize.COMMENT,
    tokenize.NL,
    tokenize.NEWLINE,
    tokenize.INDENT,
    tokenize.DEDENT,
    tokenize.ENDMARKER,
}


def docstring_lines(tree: ast.Module) -> set[int]:
    """Numbers of the lines on which a docstring stands."""
    lines: set[int] = set()
    with_docstrings = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef
    for node in ast.walk(tree):
        if isinstance(node, with_docstrings) and ast.get_docstring(node, clean=False) is not None:
            first = node.body[0]
            lines |= set(range(first.lineno, (first.end_lineno or first.lineno) + 1))
    return lines


def count(path: Path) -> tuple[int, int]:
    """Lines of code and lines of docstrings of a file."""
    source = path.read_text()
    docstrings = docstring_lines(ast.parse(source))
    code: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type not in NO_CODE:
            code |= set(range(token.start[0], token.end[0] + 1))
    return len(code - docstrings), len(docstrings)


def sizes(folder: Path, inside: Path) -> tuple[Counter[str], Counter[str], Counter[str]]:
    """Files, lines of code and lines of docstrings below `folder`, by the first part of their paths."""
    files: Counter[str] = Counter()
    code: Counter[str] = Counter()
    text: Counter[str] = Counter()
    for path in sorted([*folder.rglob("*.py"), *folder.rglob("*.pyi")]):
        parts = path.relative_to(folder).parts
        name = parts[0] if folder != inside or len(parts) > 1 else "(front)"
        if folder == inside and name in PARTS_APART:
            name = f"{name} (apart)"
        lines = count(path)
        files[name] += 1
        code[name] += lines[0]
        text[name] += lines[1]
    return files, code, text


def limits(source: str) -> tuple[dict[str, int], dict[str, int]]:
    """The limits of a file of them, and the lines that the budgets of features add to them.

    Docstrings are added as many as the core had for a line of code when the first budget was stated.
    """
    tables = tomllib.loads(source)
    budget = {
        name: sum(tables.get(table, {}).values())
        for name, table in (
            ("core_code", "budget"),
            ("core_files", "budget_files"),
            ("tests_code", "budget_tests"),
            ("experiments_code", "budget_experiments"),
        )
    }
    return tables["most"], budget | {"core_docstrings": int(0.36 * budget["core_code"])}


def raised(now: dict[str, int]) -> list[str]:
    """A sentence for each limit that an earlier commit had lower; none outside a checkout."""

    def git(*words: str) -> str:
        return subprocess.run(["git", "-C", str(ROOT), *words], capture_output=True, text=True).stdout

    known: dict[str, int] = {}
    for commit in git("log", "--format=%H", "--", LIMITS).split():
        for name, most in limits(git("show", f"{commit}:{LIMITS}"))[0].items():
            known[name] = min(most, known.get(name, most))
    return [
        f"{name} was raised from {known[name]} to {most}" for name, most in now.items() if most > known.get(name, most)
    ]


def excess(totals: dict[str, int]) -> list[str]:
    """A sentence for each total above its limit, and for each limit that has been raised."""
    most, budget = limits((ROOT / LIMITS).read_text())
    above = [
        f"{name} is {totals[name]}, at most {limit} are allowed: take something out, or state a budget in {LIMITS}"
        for name, limit in most.items()
        if totals[name] > limit + budget.get(name, 0)
    ]
    return above + raised(most)


def main() -> int:
    """Print the lines; 1 if there are more than the limits allow."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", nargs="?", type=Path, help="a folder whose files are counted one by one")
    parser.add_argument("--most", action="store_true", help=f"fail above the limits in {LIMITS}")
    options = parser.parse_args()
    package = ROOT / "hysim"
    files, code, text = sizes(options.folder.resolve() if options.folder else package, package)
    print(f"{'':34s}{'files':>7s}{'code':>8s}{'docstrings':>12s}")
    for name in code:
        print(f"{name:34s}{files[name]:7d}{code[name]:8d}{text[name]:12d}")
    counted = [name for name in code if not name.endswith("(apart)")]
    total_files, total_code, total_text = (sum(counter[name] for name in counted) for counter in (files, code, text))
    print(f"{'total':34s}{total_files:7d}{total_code:8d}{total_text:12d}")
    if options.folder:
        return 0
    totals = {"core_code": total_code, "core_docstrings": total_text, "core_files": total_files}
    for name in ("tests", "experiments"):
        beside = sizes(ROOT / name, package)
        print(
            f"{name:34s}"
            + "".join(f"{sum(each.values()):{width}d}" for each, width in zip(beside, (7, 8, 12), strict=True))
        )
        totals[f"{name}_code"] = sum(beside[1].values())
    sentences = excess(totals) if options.most else []
    print("\n".join(sentences), file=sys.stderr)
    return int(bool(sentences))


if __name__ == "__main__":
    sys.exit(main())
