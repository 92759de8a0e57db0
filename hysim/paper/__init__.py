"""The paper, as a wing on top of the library: its equations, its figures, and `reproduce`.

B. B. Muhammad, M. H. Rahman, M. R. Ahmad and M. Bashir, "A novel model of PZT actuator and its
application in hysteresis and vibration controls", Jurnal Teknologi (2016).
"""

from hysim.paper.reproduction import reproduce

__all__ = ["reproduce"]
