"""Energies of a structure: the work of its loads and of its damping over a step."""

from hysim._frozen import FloatArray
from hysim.kernels._compile import uncounted, unfolded
from hysim.kernels.structures.flows import add_columns
from hysim.kernels.structures.layout import Flows, Motion, Plant, Room
from hysim.kernels.structures.sweeps import halve


@unfolded
def add_work(flows: Flows, plant: Plant, level: int, h: float, share: float, motion: Motion, room: Room) -> None:
    """Work of the loads and of the damping over a step, from the powers and two derivatives at three points of it."""
    x, work, inputs, m = motion.x, motion.work, room.inputs, motion.x.size
    n_loads = motion.loads.size
    for i in range(n_loads):
        inputs[m + 2 * i + 1] *= 0.5
    for q in range(m):
        room.point[q] = 0.0
    add_columns(flows.free[level + 1], inputs, room.point)
    halve(room.rest, room.half)
    add_columns(flows.rests[level + 1], room.half, room.point)
    for i in range(n_loads):
        inputs[m + 2 * i + 1] *= 2.0
    for k in range(3):
        for q in range(m):
            room.now[q] = x[q] if k == 0 else room.point[q] if k == 1 else room.end[q]
        add_powers(plant, h, share, 0.5 * k, 1.0 - k, room.now, room, work)


@unfolded
def add_powers(
    plant: Plant, h: float, share: float, s: float, side: float, x: FloatArray, room: Room, work: FloatArray
) -> None:
    """The part of one point, at the share s of the step, in the integrals of the powers.

    Weights of values and two derivatives at begin, middle and end: exact for polynomials of degree 8.
    """
    n, n_loads, n_elements = x.size // 2, room.loads.shape[1], room.own.size
    value, first, second = (
        (64.0 / 105.0, 0.0, 2.0 / 315.0) if side == 0.0 else (41.0 / 210.0, side / 70.0, 1.0 / 2520.0)
    )
    a, j = room.speeds[0], room.speeds[1]
    derivatives(plant.A, x, x[n:], a)
    for i in range(n_loads):
        load = room.loads[1, i] + s * share * room.loads[0, i]
        for q in range(n):
            a[q] += load * plant.loads[i, n + q]
    for e in range(n_elements):
        c0, c1, c2, c3 = room.rest[4 * e], room.rest[4 * e + 1], room.rest[4 * e + 2], room.rest[4 * e + 3]
        load = c0 + s * (c1 + s * (c2 + s * c3))
        for q in range(n):
            a[q] += load * plant.loads[n_loads + e, n + q]
    derivatives(plant.A, x[n:], a, j)
    for i in range(n_loads):
        for q in range(n):
            j[q] += share * room.loads[0, i] / h * plant.loads[i, n + q]
    for e in range(n_elements):
        c1, c2, c3 = room.rest[4 * e + 1], room.rest[4 * e + 2], room.rest[4 * e + 3]
        for q in range(n):
            j[q] += (c1 + s * (2.0 * c2 + s * 3.0 * c3)) / h * plant.loads[n_loads + e, n + q]
    for i in range(n_loads):
        load, slope = room.loads[1, i] + s * share * room.loads[0, i], share * room.loads[0, i] / h
        rate = change = bend = 0.0
        for q in range(n):
            weight = plant.directions[i, q]
            rate, change, bend = rate + weight * x[n + q], change + weight * a[q], bend + weight * j[q]
        work[0] += h * value * load * rate + h * h * first * (slope * rate + load * change)
        work[0] += h * h * h * second * (2.0 * slope * change + load * bend)
    for q in range(n):
        force = rise = 0.0
        for p in range(n):
            force += plant.damping[q, p] * x[n + p]
            rise += plant.damping[q, p] * a[p]
        work[1] += h * value * force * x[n + q] + 2.0 * h * h * first * force * a[q]
        work[1] += 2.0 * h * h * h * second * (rise * a[q] + force * j[q])


@uncounted
def derivatives(A: FloatArray, x: FloatArray, v: FloatArray, out: FloatArray) -> None:
    """Accelerations of the linear part without loads at displacements x and velocities v."""
    n = out.size
    for q in range(n):
        total = 0.0
        for p in range(n):
            total += A[n + q, p] * x[p] + A[n + q, n + p] * v[p]
        out[q] = total
