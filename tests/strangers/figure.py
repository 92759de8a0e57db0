"""A figure of a thesis: minor loops of a magnet, and the density of its relays from first-order reversal curves."""

import numpy as np

import hysim as hs

curves = hs.signals.reversal_curves(-1.0, 1.0, curves=12, samples_per_step=4)  # kA/m
magnet = hs.Preisach.from_density(
    np.linspace(-1.0, 1.0, 25), lambda a, b: np.exp(-20.0 * (a + b) ** 2 - 8.0 * (a - b - 0.8) ** 2)
)
units = {"u": "kA/m", "y": "T"}
measured = hs.Record(u=curves, y=magnet.response(curves), units=units, name="reversal curves")
minor = hs.signals.triangle(-1.0, 1.0, cycles=1, samples_per_cycle=200)
minor = np.concatenate([share * minor for share in (1.0, 0.8, 0.6, 0.4, 0.2)])
loops = hs.Record(u=minor, y=magnet.response(minor), units=units, name="minor loops")
with hs.plot.house_style():
    figure = hs.plot.figure(8.0, 3.4)
    left, right = figure.subplots(1, 2)
    hs.plot.minor_loops(loops, left).set_title("minor loops")
    hs.plot.forc(measured, right)
    figure.savefig("figure.pdf")
    figure.savefig("figure.svg")
hs.save_record(measured, "curves.csv")
