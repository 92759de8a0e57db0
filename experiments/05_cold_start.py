"""How long is the first call? Each function in a process of its own: compiled, with the code of a wheel, and again.

numba compiles a function when it is first called and keeps the code in a folder. A wheel may hold code, too: here it is
compiled by `hatch_build.py`, which takes minutes and hatchling, in a copy of the package. The times are those of the
processor, of one call on 200 samples, without the import of numpy, scipy and numba.
"""

import os
import runpy
import subprocess
import sys
import tempfile
from pathlib import Path

from hysim.plot import Figure

sys.path.insert(0, str(Path(__file__).parent))
from results_folder import one_panel, write_results

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "experiments" / "results" / "cold_start"
Row = dict[str, float | str]

LAW = "hs.BoucWen(n=1.5, feedthrough=1.0)"
PLANT = f"hs.BoucWenOscillator(mass=1.0, damping=0.1, stiffness=1.0, law={LAW}, method='%s')"
CALLS = {
    "response, n = 1": "hs.BoucWen().response(u)",
    "response, other n": f"{LAW}.response(u)",
    "responses": "hs.BoucWen.responses({'n': [1.0, 1.5]}, u)",
    "inverse_response": f"{LAW}.inverse_response(u)",
    "CustomLaw": "hs.CustomLaw(step=lambda p, s, u: p[0] * u, parameters={'a': 2.0}).response(u)",
    "oscillator, split": f"{PLANT % 'split'}.response(u, 0.1)",
    "oscillator, strang": f"{PLANT % 'strang'}.response(u, 0.1)",
    "identify, plays": "hs.identify(hs.PrandtlIshlinskii, hs.datasets.table1())",
    "identify, Bouc-Wen": "hs.identify(hs.BoucWen, hs.datasets.table1())",
    "close_loop": f"hs.close_loop(hs.Actuator(hysteresis={LAW}), hs.PID(ki=1.0), 0.01 * np.arange(200), u)",
    "earthquake of a frame": f"hs.simulate(hs.shear_frame([1.0] * 3, laws=[{LAW}] * 3), 0.02 * np.arange(200), u)",
}
CACHES = ("compiled", "from a wheel", "from the cache")
SCRIPT = """import time, numba, numpy as np, scipy.linalg, scipy.optimize, scipy.signal
u = np.sin(np.linspace(0.0, 13.0, 200))
begin = time.process_time()
import hysim as hs
{call}
print(time.process_time() - begin)"""


def first_call(call: str, cache: str, package: Path) -> float:
    """Seconds of the processor that a call takes in a new process, with `hysim` in the folder `package`."""
    command = [sys.executable, "-c", SCRIPT.format(call=call)]
    environment = os.environ | {"NUMBA_CACHE_DIR": cache, "PYTHONPATH": os.pathsep.join(sys.path)}
    return float(subprocess.run(command, cwd=package, env=environment, check=True, stdout=subprocess.PIPE).stdout)


def main(smoke: bool = False) -> list[Row]:
    """Measure, and unless it is a smoke run write table, figure and JSON."""
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as folder:
        if not smoke:
            runpy.run_path(str(ROOT / "hatch_build.py"))["copy_with_code"](ROOT / "hysim", Path(folder))
        packages = dict(zip(CACHES[: 1 if smoke else None], (ROOT, Path(folder), ROOT), strict=False))
        for name, call in list(CALLS.items())[: 1 if smoke else None]:
            seconds = {how: first_call(call, f"{folder}/{name}/{each.name}", each) for how, each in packages.items()}
            rows.append({"function": name, **seconds})
    return write_results(RESULTS, rows, draw, {}, smoke=smoke)


def draw(rows: list[Row]) -> Figure:
    """One bar for each function and cache."""
    canvas, ax = one_panel(3.6)
    places = range(len(rows), 0, -1)
    for cache, shift in zip(CACHES, (0.27, 0.0, -0.27), strict=True):
        ax.barh([place + shift for place in places], [row[cache] for row in rows], 0.27, label=cache)
    ax.set_yticks(list(places), [str(row["function"]) for row in rows])
    ax.set(xlabel="First call [s of one processor]")
    ax.legend(loc="upper right")
    return canvas


if __name__ == "__main__":
    for line in main():
        print(f"{line['function']:22}" + ", ".join(f"{line[cache]:6.2f} s {cache}" for cache in CACHES))
