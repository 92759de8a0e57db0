"""Public loops of magnetic cores (github.com/romanszewczyk/JAmodel), which are not part of hysim."""

from pathlib import Path

import numpy as np

import hysim as hs

AMPLITUDES = {"MnZn_ferrite": 3, "M130_27s": 3, "amorf": 1}  # that were measured on each material


def core_loops(folder: Path, material: str) -> list[hs.Record]:
    """Field [A/m] and flux density [T] of a material in a folder of records, one loop for each amplitude."""
    several = AMPLITUDES[material] > 1
    loops = []
    for k in range(AMPLITUDES[material]):
        names = {x: f"{x}measT[{k}]" if several else f"{x}measT" for x in "HB"}
        field, flux = (column(folder / "magnetic_jamodel" / f"{x}_{material}.mat", names[x]) for x in "HB")
        loops.append(hs.Record(u=field, y=flux, name=f"{material} {k + 1}"))
    return loops


def column(path: Path, name: str) -> np.ndarray:
    """One column of a file."""
    return hs.load(path, u=name, y=name, t=False).u
