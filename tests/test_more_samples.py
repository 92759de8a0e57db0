"""More samples on a monotone branch of the input change nothing: every law, forwards and backwards.

The laws, states and strides are those of `experiments/32_more_samples.py`, and so is what may differ; see
`experiments/more_samples.py` for the reason of each tolerance.
"""

import importlib.util
import sys
from pathlib import Path

import pytest

import hysim as hs

EXPERIMENTS = Path(__file__).parent.parent / "experiments"
sys.path.insert(0, str(EXPERIMENTS))
spec = importlib.util.spec_from_file_location("more_samples_experiment", EXPERIMENTS / "32_more_samples.py")
experiment = importlib.util.module_from_spec(spec)
spec.loader.exec_module(experiment)

N_CASES = 2 if hs.kernels._compile.numba.config.DISABLE_JIT else 40

NOT_RATE_INDEPENDENT = {
    "TransferFunction", "StateSpace", "Modes", "Creep", "Dashpot", "Amplifier", "Sensor", "Actuator", "BoucWenOscillator",
}  # fmt: skip
"""Between two samples the input of these is held, or goes on a line: with more samples it is another input."""
INVERSES = {"BoucWenInverse"}  # under the laws that it inverts


def test_every_law_that_hysim_exports_is_among_the_families():
    """A new law is either drawn here, or it says why its samples matter."""
    exported = {
        name for name in hs.__all__ if isinstance(getattr(hs, name), type) and hasattr(getattr(hs, name), "response")
    }
    assert exported == {*experiment.DRAWS, *NOT_RATE_INDEPENDENT - {"Amplifier", "Sensor"}, *INVERSES}
    undone = {name for name in experiment.DRAWS if hasattr(getattr(hs, name), "inverse_response")}
    assert undone == set(experiment.INVERTED)


@pytest.mark.parametrize("family", experiment.DRAWS)
def test_more_samples_change_nothing(family):
    found = experiment.chunk(family, 0, N_CASES)
    assert found["wrong"] == []
    for path, ends in found["ends"].items():
        assert ends.get("compared", 0) > N_CASES // 2, (path, ends)  # most laws neither escape nor are refused
