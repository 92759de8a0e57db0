"""A study with arrays, which version 0.2 wrote to files in a folder. Run it with that version.

python tests/data/version_0_2/generate.py
"""

from pathlib import Path

import hysim as hs


def squares(a: float) -> dict[str, object]:
    """A task of a number and an array, which fails at 2."""
    if a == 2.0:
        raise ValueError("two")
    return {"square": a * a, "both": [a, a * a]}


if __name__ == "__main__":
    hs.sweep(squares, {"a": [1.0, 2.0, 3.0]}, store=Path(__file__).with_name("study.sqlite"), workers=1)
