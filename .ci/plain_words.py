"""Does a text or a name use a word of WORDS or NAMES, for which the field has a plainer one?

    python .ci/plain_words.py   each hit as path:line: word -> what to write; exit status 1 if there is one

Searched are the pages without their code, the first paragraphs of docstrings, the messages of errors and warnings, and
the names that hysim assigns. A hit that EXCEPTIONS allows is not printed.
"""

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PAGES = ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "docs/*.md", "docs/teaching/*.md", "experiments/README.md")
WORDS = {
    r"of which": "a second sentence",
    r"[Bb]eside": "compared with, next to, and",
    r"[Bb]ehind": "after, in series after",
    r"[Ii]n (the|its|their) place of": "instead of, replaced by",
    r"as they are|as it has been": "unchanged",
    r"hardly tell|cannot tell|does not tell": "cannot be estimated, cannot be distinguished",
    r"none(?! of\b)": "no and the noun",
    r"[Ee]scapes?": "diverges",
    r"(?:gives|comes) back": "returns",
    r"to and fro": "both ways, back and forth",
    r"There (?:is|are) (?:an?|no)": "the thing itself as the subject",
}
NAMES = {"found": "optima, hits", "left": "remaining", "whole": "problem, period", "seen": "reading"}
NAMES |= {"moved": "displacement, changed", "given": "arguments, options"}
# Beginning of the path, word, hits, reason. The numbers may only fall.
TRANSLATED = "the text of kernels is also C and WebAssembly, whose marks a new name would change"
EXCEPTIONS = (
    ("docs/compared.md", "Beside", 1, "the heading of a page"),
    ("hysim/design/_design.py", "beside", 1, "the public argument of design_input"),
    ("hysim/kernels/", "left", 18, TRANSLATED),
    ("hysim/kernels/", "moved", 11, TRANSLATED),
    ("hysim/kernels/", "whole", 5, TRANSLATED),
    ("hysim/paper/", "found", 3, "the fields that the report reads"),
)


def blank(pattern: str, text: str) -> str:
    """The text with each match replaced by spaces, so that lines and columns stay."""
    return re.sub(pattern, lambda match: re.sub(r"\S", " ", match[0]), text, flags=re.MULTILINE | re.DOTALL)


def prose(text: str, line: int) -> Iterator[tuple[int, str, str]]:
    """Line, word and suggestion of each hit in a text that begins on `line`."""
    text = blank(r"``.+?``|`[^`]+?`", blank(r"^ *(```+|~~~+).*?^ *\1", text))
    for pattern, plain in WORDS.items():
        for match in re.finditer(rf"(?<![-\w])(?:{pattern.replace(' ', chr(92) + 's+')})\b", text):
            yield line + text.count("\n", 0, match.start()), " ".join(match[0].split()), plain


def assigned(node: ast.AST) -> str:
    """The name that a node assigns or takes as a parameter; else empty."""
    name = node.id if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store) else ""
    return node.arg if isinstance(node, ast.arg) else name


def module(source: str) -> Iterator[tuple[int, str, str]]:
    """The hits of a module: its docstrings, its messages and its names; `left` is a side where `right` is a name."""
    nodes = list(ast.walk(ast.parse(source)))
    sides = {"left"} if "right" in map(assigned, nodes) else set[str]()
    for node in nodes:
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node):
            first: ast.expr = node.body[0].value  # type: ignore[attr-defined]
            yield from prose(str(ast.literal_eval(first)).lstrip().split("\n\n")[0], first.lineno)
        call = node.exc if isinstance(node, ast.Raise) else node
        if isinstance(call, ast.Call) and (call is not node or ast.unparse(call.func).split(".")[-1] == "warn"):
            for part in ast.walk(call):
                if isinstance(part, ast.Constant) and isinstance(part.value, str):
                    yield from prose(part.value, part.lineno)
        name = assigned(node)
        if name.strip("_") in NAMES.keys() - sides:
            yield node.lineno, name, NAMES[name.strip("_")]  # type: ignore[attr-defined]


def hits() -> Iterator[tuple[str, int, str, str]]:
    """Path, line, word and suggestion of each hit."""
    for path in [*(path for page in PAGES for path in sorted(ROOT.glob(page))), *sorted(ROOT.glob("hysim/**/*.py"))]:
        text = path.read_text(encoding="utf-8")
        text = "\n## ".join(text.split("\n## ")[:2]) if path.name == "CHANGELOG.md" else text
        for line, word, plain in module(text) if path.suffix == ".py" else prose(text, 1):
            yield str(path.relative_to(ROOT)), line, word, plain


def main() -> int:
    """Print the hits that no exception allows; 1 if there is one."""
    rest = {exception[:2]: exception[2] for exception in EXCEPTIONS}
    refused = []
    for path, line, word, plain in hits():
        places = [place for place, most in rest.items() if most and path.startswith(place[0]) and place[1] == word]
        rest |= {place: rest[place] - 1 for place in places}
        refused += [] if places else [f"{path}:{line}: {word} -> {plain}"]
    print("\n".join(refused), end="\n" if refused else "")
    return int(bool(refused))


if __name__ == "__main__":
    sys.exit(main())
