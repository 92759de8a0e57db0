"""How long is the first call? Each function of the engine in a process of its own, with an empty cache and a full one.

numba compiles a function when it is first called and keeps the code in a folder. The times are those of the
processor, of one call on 200 samples, without the import of numpy, scipy and numba.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from hysim.plot import Figure, figure

sys.path.insert(0, str(Path(__file__).parent))
from results_folder import write_results

RESULTS = Path(__file__).parent / "results" / "cold_start"
Row = dict[str, float | str]

LAW = "hs.BoucWen(n=1.5, feedthrough=1.0)"
PLANT = f"hs.BoucWenOscillator(mass=1.0, damping=0.1, stiffness=1.0, law={LAW}, method='%s')"
CALLS = {
    "response, n = 1": "hs.BoucWen().response(u)",
    "response, other n": f"{LAW}.response(u)",
    "responses": "hs.BoucWen.responses({'n': [1.0, 1.5]}, u)",
    "responses, reduced": "hs.BoucWen.responses({'n': [1.0, 1.5]}, u, reduce='max_width')",
    "inverse_response": f"{LAW}.inverse_response(u)",
    "limit_cycle": f"{LAW}.limit_cycle(1.0)",
    "CustomLaw": "hs.CustomLaw(step=lambda p, s, u: p[0] * u, parameters={'a': 2.0}).response(u)",
    "oscillator, split": f"{PLANT % 'split'}.response(u, 0.1)",
    "oscillator, strang": f"{PLANT % 'strang'}.response(u, 0.1)",
    "oscillator, newmark": f"{PLANT % 'newmark'}.response(u, 0.1)",
    "simulate_official": "hs.benchmarks.simulate_official(u)",
}
CACHES = ("empty", "full")
SCRIPT = """
import time, numba, numpy as np, scipy.linalg, scipy.optimize, scipy.signal
u = np.sin(np.linspace(0.0, 13.0, 200))
begin = time.process_time()
import hysim as hs
{call}
print(time.process_time() - begin)
"""


def first_call(call: str, cache: str) -> float:
    """Seconds of the processor that a call takes in a new process."""
    environment = os.environ | {"NUMBA_CACHE_DIR": cache, "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-c", SCRIPT.format(call=call)]
    run = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
    return float(run.stdout)


def main(smoke: bool = False) -> list[Row]:
    """Measure, and unless it is a smoke run write table, figure and JSON."""
    rows: list[Row] = []
    for name, call in list(CALLS.items())[: 1 if smoke else None]:
        with tempfile.TemporaryDirectory() as folder:
            seconds = {cache: first_call(call, folder) for cache in CACHES[: 1 if smoke else 2]}
            rows.append({"function": name, **seconds})
    if not smoke:
        write_results(RESULTS, rows, draw, {})
    return rows


def draw(rows: list[Row]) -> Figure:
    """One bar for each function and cache."""
    canvas = figure(height=3.6)
    ax = canvas.add_subplot()
    places = range(len(rows), 0, -1)
    for cache, shift in (("empty", 0.2), ("full", -0.2)):
        ax.barh([place + shift for place in places], [row[cache] for row in rows], 0.4, label=f"{cache} cache")
    ax.set_yticks(list(places), [str(row["function"]) for row in rows])
    ax.set(xlabel="First call [s of one processor]")
    ax.legend(loc="lower right")
    return canvas


if __name__ == "__main__":
    for line in main():
        print(f"{line['function']:20} {line['empty']:6.2f} s, then {line['full']:5.2f} s")
