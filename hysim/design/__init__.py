"""Inputs that tell most of a law's numbers, within the limits of an actuator."""

from hysim.design._design import design_input as design_input
from hysim.design._limits import InputLimits as InputLimits
from hysim.design._result import InputDesign as InputDesign
