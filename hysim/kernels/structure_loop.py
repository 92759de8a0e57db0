"""A sampled controller around a structure.

The first load, the controller's force, is held between samples; the others are linear. At each sample it reads

    y = weights . (x, v, forces of the elements, force of the controller before the sample)

and then its force jumps.
"""

from typing import Any

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import kernel
from hysim.kernels.controllers import LARGEST, guarded
from hysim.kernels.structure_layout import Elements, Flows, Motion, Plant, Room, Steps, Tracks
from hysim.kernels.structure_pointers import controller_at, follow_at

Controller = tuple[Any, FloatArray, FloatArray]
"""Address of its step, see `pointers`, parameters, and state."""


@kernel
def close(
    controller: Controller, follow: Any, structure: tuple[Elements, Flows, Plant, Steps], is_first: bool,
    weights: FloatArray, inputs: FloatArray, motion: Motion, room: Room, samples: FloatArray, tracks: Tracks,
) -> int:  # fmt: skip
    """Run the samples of `inputs`, (n, n_loads): the first one that is not finite, or -1.

    `follow` is an address, see `pointers`; the controller's state moves along, as `motion` does. The first column of
    `inputs` is the reference, the others are loads. `samples`, (n, 3), is for command, drive and y.
    """
    address, parameters, state = controller
    elements, flows, plant, steps = structure
    step, walk = controller_at(address), follow_at(follow)
    m, n_elements, n_loads = motion.x.size, elements.k0.size, inputs.shape[1]
    loads = np.empty((1, n_loads))
    for k in range(inputs.shape[0]):
        loads[0, 0] = motion.loads[0]
        for i in range(1, n_loads):
            loads[0, i] = inputs[k, i]
        row = Tracks(
            tracks.x[k : k + 1], tracks.carry[k : k + 1], tracks.peaks[k : k + 1], tracks.work[k : k + 1], tracks.laws
        )
        lost = walk(elements, flows, plant, steps, is_first and k == 0, loads, motion, room, row)
        if lost >= 0:
            return k
        y = weights[m + n_elements] * motion.loads[0]
        for q in range(m):
            y += weights[q] * motion.x[q]
        for e in range(n_elements):
            y += weights[m + e] * motion.carry[0, e]
        drive = guarded(step, parameters, state, inputs[k, 0], y)
        samples[k, 0], samples[k, 1], samples[k, 2] = state[0], drive, y
        if not (abs(y) < LARGEST and abs(drive) < LARGEST):
            return k
        motion.loads[0] = drive
    return -1
