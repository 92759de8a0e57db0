"""Compile the steps of all laws of the registry to WebAssembly: ``python -m hysim.export.build_pages [FOLDER]``.

It writes the modules that pages embed, by default into the package. It needs the extra `export`, whose ziglang is
pinned, so that the same sources give the same bytes.
"""

import sys
from collections.abc import Iterator
from pathlib import Path

from hysim.export._page_modules import FOLDER, Kernels, c_source, compiled, compressed, kernels_of
from hysim.kernels import baber_noori, boucwen, clamps, duhem, generalized, play_sums, preisach, stepping, zhu_wang

STEPS = (
    stepping.line,
    boucwen.linear_step,
    boucwen.step,
    zhu_wang.step,
    generalized.step,
    baber_noori.step,
    duhem.step,
    clamps.step,
    clamps.bent_step,
    play_sums.step,
    preisach.step,
)
"""The steps of the registry's laws; a test compares them with the registry."""


def modules() -> Iterator[tuple[Kernels, bytes]]:
    """Each step, and its module."""
    for step in STEPS:
        kernels = kernels_of(step)
        yield kernels, compiled(c_source(kernels))


def main(folder: Path) -> None:
    """Write all modules into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for kernels, module in modules():
        content = compressed(module)
        folder.joinpath(f"{kernels.name}.wasm.gz").write_bytes(content)
        print(f"{kernels.name}: {len(module)} bytes, {len(content)} compressed")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / FOLDER)
