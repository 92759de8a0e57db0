"""Many copies of a law, each with parameters and a memory of its own, moved by one sample."""

from numba import float64, void

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import signed_kernel
from hysim.kernels.batches import ROWS, TABLE
from hysim.kernels.stepping import START, STEP, VECTOR, Start, Step

_SIGNATURE = void(STEP, START, TABLE, ROWS, VECTOR, float64, float64, VECTOR)


@signed_kernel(_SIGNATURE)
def step_each(
    step: Step,
    start: Start,
    parameters: FloatArray,
    memory: FloatArray,
    state: FloatArray,
    before: float,
    u: float,
    y: FloatArray,
) -> None:
    """Outputs of all copies at the next input `u`, from the input `before`; their memories move along.

    `parameters` is (n_copies, n_parameters), `memory` the front of each state, (n_copies, n_memory), whose first place
    is that of the last input. `state` has room for one state with its workspace, which is made anew for each copy.
    """
    for i in range(y.size):
        for k in range(state.size):
            state[k] = 0.0
        start(parameters[i], state, before)
        state[0] = before
        for k in range(1, memory.shape[1]):
            state[k] = memory[i, k]
        y[i] = step(parameters[i], state, u)
        for k in range(memory.shape[1]):
            memory[i, k] = state[k]
