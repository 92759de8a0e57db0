"""A simulated experiment: an actuator under a microscope, from the command to the table that its camera gives.

The chain is  drive -> amplifier -> law -> vibration -> exposure -> frames -> displacement -> record.  Every stage is
known exactly, so that what is identified at its end can be held against the truth.
"""

from hysim.rig._camera import Camera, Frames
from hysim.rig._drive import SQUARE_WAVES, Drive, square_drive, staircase_drive
from hysim.rig._rig import LAW, SUPPLY, UA741, Experiment, Rig, table1

__all__ = [
    "LAW",
    "SQUARE_WAVES",
    "SUPPLY",
    "UA741",
    "Camera",
    "Drive",
    "Experiment",
    "Frames",
    "Rig",
    "square_drive",
    "staircase_drive",
    "table1",
]
