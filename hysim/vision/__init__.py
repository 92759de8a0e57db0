"""Displacement from camera frames: how far a picture has moved, to a hundredth of a pixel, and how sure that is."""

from hysim.vision._displacement import displacement
from hysim.vision._frames import FrameSource, read_frames
from hysim.vision._result import Displacement

__all__ = ["Displacement", "FrameSource", "displacement", "read_frames"]
