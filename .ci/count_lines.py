"""How long is the package? Lines of code and of docstrings, folder by folder.

    python .ci/count_lines.py                    every folder of hysim/, and the total less PARTS_APART
    python .ci/count_lines.py hysim/models       every file of one folder
    python .ci/count_lines.py --most 18000 9000  exit status 1 if the total has more lines of code or of docstrings

A line of code holds a token that is no comment, of a statement that is no docstring; blank lines do not count. Stubs
(`*.pyi`) count as code.
"""

import argparse
import ast
import io
import sys
import tokenize
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
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


def main() -> int:
    """Print the lines; 1 if there are more than was asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", nargs="?", type=Path, help="a folder whose files are counted one by one")
    parser.add_argument("--most", nargs=2, type=int, metavar=("CODE", "DOCSTRINGS"), help="limits of the total")
    options = parser.parse_args()
    package = ROOT / "hysim"
    folder = options.folder.resolve() if options.folder else package
    code: Counter[str] = Counter()
    text: Counter[str] = Counter()
    files: Counter[str] = Counter()
    for path in sorted([*folder.rglob("*.py"), *folder.rglob("*.pyi")]):
        parts = path.relative_to(folder).parts
        name = parts[0] if folder != package or len(parts) > 1 else "(front)"
        if folder == package and name in PARTS_APART:
            name = f"{name} (apart)"
        lines = count(path)
        code[name] += lines[0]
        text[name] += lines[1]
        files[name] += 1
    print(f"{'':34s}{'files':>7s}{'code':>8s}{'docstrings':>12s}")
    for name in code:
        print(f"{name:34s}{files[name]:7d}{code[name]:8d}{text[name]:12d}")
    counted = [name for name in code if not name.endswith("(apart)")]
    totals = [sum(counter[name] for name in counted) for counter in (files, code, text)]
    print(f"{'total':34s}{totals[0]:7d}{totals[1]:8d}{totals[2]:12d}")
    return int(bool(options.most) and (totals[1] > options.most[0] or totals[2] > options.most[1]))


if __name__ == "__main__":
    sys.exit(main())
