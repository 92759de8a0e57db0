"""Compile the steps of all laws of the registry to WebAssembly: ``python .ci/build_pages.py [FOLDER]``.

It writes the modules that pages embed, by default into the package. It needs the extra `export`, whose ziglang is
pinned, so that the same sources give the same bytes.
"""

import sys
from pathlib import Path

from hysim.export._compilers import FOLDER, Kernels, c_source, compiled, compressed
from hysim.export._page import presets
from hysim.export._page_model import steps_of

ROOT = Path(__file__).resolve().parent.parent


def kernels() -> list[Kernels]:
    """The steps of all models with which the explorer begins, each once."""
    return sorted({each for shown in presets().values() for each in steps_of(shown.model)}, key=lambda each: each.name)


def main(folder: Path) -> None:
    """Write all modules into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for each in kernels():
        module = compiled(c_source(each))
        content = compressed(module)
        folder.joinpath(f"{each.name}.wasm.gz").write_bytes(content)
        print(f"{each.name}: {len(module)} bytes, {len(content)} compressed")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "hysim/export" / FOLDER)
