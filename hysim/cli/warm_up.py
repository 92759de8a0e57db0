"""`hysim warm-up`: the calls whose code is compiled in advance, here or in a wheel (`hatch_build.py`)."""

from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any

import hysim as hs
from hysim._basics.progress import Progress, announced_by, reports


def calls() -> dict[str, Callable[[], object]]:
    """Short calls that compile what most first calls need, by their names."""
    import numpy as np

    from hysim.models.model import candidates
    from hysim.models.protocols import Invertible, needs_time
    from hysim.plants.equation_of_motion import METHODS

    u, record = np.sin(np.linspace(0.0, 13.0, 200)), hs.datasets.table1()
    t = 0.01 * np.arange(u.size)
    law = hs.BoucWen(n=1.5, feedthrough=1.0)
    frame = hs.shear_frame([1.0, 1.0], laws=[law, law], damping=hs.ModalDamping(ratio=0.03))
    stage = hs.Actuator(
        hysteresis=law, creep=hs.Creep(time_constants=(1.0,), weights=(0.1,)), vibration=hs.mode(20.0, 0.1)
    )
    follow = hs.TrackingController(feedforward=hs.InverseFeedforward(law=law), feedback=hs.PID(ki=1.0))
    learn = hs.AdaptiveInverse(law=law, free=("gain",), drift=(0.1,), noise=0.01)

    def one(family: Any) -> None:
        low, high = family.example.between
        model = family(**family.example.fields)
        time = [t[1]] * needs_time(model)
        y = model.response(low + (high - low) * (0.5 + 0.5 * u), *time)
        if isinstance(model, Invertible) and model.inverse_response is not None:
            with suppress(ValueError, hs.SimulationError):  # of a law that has no inverse for this output
                model.inverse_response(y, *time)

    def oscillator(method: Any) -> None:
        hs.BoucWenOscillator(mass=1.0, damping=0.1, stiffness=1.0, law=law, method=method).response(u, 0.1)

    return {
        **{name: partial(one, family) for name, family in hs.families().items()},
        "responses": lambda: hs.BoucWen.responses({"n": [1.0, 1.5, 2.0]}, u),
        **{f"oscillator, {each}": partial(oscillator, each) for each in METHODS},
        "frame": lambda: hs.simulate(frame, t, u),
        "closed loop": lambda: [hs.close_loop(stage, each, t, u) for each in (follow, learn)],
        **{
            f"identify {name}": partial(hs.identify, each, record, max_evaluations=1)
            for name, each in candidates().items()
        },
    }


@reports
def compilation(progress: Progress | None = None) -> int:
    every = calls()
    announce = announced_by(progress) or (lambda _: None)
    for k, (name, call) in enumerate(every.items()):
        announce(name)
        if progress is not None:
            progress(k, len(every))
        call()
    return len(every)


def warm_up() -> None:
    """Compile in advance what first calls would compile.

    Make short calls of most functions, which takes minutes; their code is kept on disk for later processes.

    Examples
    --------
    hysim warm-up
    """
    print(f"{compilation()} calls have been compiled")
