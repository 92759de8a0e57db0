"""Inputs that tell most of a law's numbers, within the limits of an actuator."""

from hysim.design._design import InputDesign as InputDesign
from hysim.design._design import design_input as design_input
from hysim.design._inputs import InputLimits as InputLimits
