"""hysim: simulate, identify, discover, compensate and compare hysteretic actuators.

The names below are the whole public face, in reading order. They are loaded when first used: the bare
import costs the standard library only.
"""

import importlib
from typing import TYPE_CHECKING, Any

from hysim._names import HOME, MODULES
from hysim._release import __version__ as __version__

__all__ = ["__version__", *MODULES, *HOME]

if TYPE_CHECKING:
    from hysim import benchmarks as benchmarks
    from hysim import control as control
    from hysim import datasets as datasets
    from hysim import metrics as metrics
    from hysim import plot as plot
    from hysim import rig as rig
    from hysim import signals as signals
    from hysim import vision as vision
    from hysim._versions import show_versions as show_versions
    from hysim.comparison import Comparison as Comparison
    from hysim.comparison import compare as compare
    from hysim.control import PID as PID
    from hysim.control import ClosedLoop as ClosedLoop
    from hysim.control import CSource as CSource
    from hysim.control import DampingLoop as DampingLoop
    from hysim.control import InverseFeedforward as InverseFeedforward
    from hysim.control import ModeInverse as ModeInverse
    from hysim.control import Notch as Notch
    from hysim.control import Shaper as Shaper
    from hysim.control import TrackingController as TrackingController
    from hysim.control import Tuning as Tuning
    from hysim.control import close_loop as close_loop
    from hysim.control import to_c as to_c
    from hysim.control import to_control as to_control
    from hysim.control import tune as tune
    from hysim.discovery import Discovery as Discovery
    from hysim.discovery import OscillatorDiscovery as OscillatorDiscovery
    from hysim.discovery import discover as discover
    from hysim.discovery import discover_oscillator as discover_oscillator
    from hysim.errors import SimulationError as SimulationError
    from hysim.files import load as load
    from hysim.files import save_record as save_record
    from hysim.identification import Identification as Identification
    from hysim.identification import Selection as Selection
    from hysim.identification import identify as identify
    from hysim.identification import select as select
    from hysim.metrics import CycleMetrics as CycleMetrics
    from hysim.metrics import LoopMetrics as LoopMetrics
    from hysim.metrics import cycle_metrics as cycle_metrics
    from hysim.metrics import loop_metrics as loop_metrics
    from hysim.models.actuator import Actuator as Actuator
    from hysim.models.amplifier import Amplifier as Amplifier
    from hysim.models.baber_noori import BoucWenBaberNoori as BoucWenBaberNoori
    from hysim.models.boucwen import BoucWen as BoucWen
    from hysim.models.boucwen_inverse import BoucWenInverse as BoucWenInverse
    from hysim.models.cascade import Cascade as Cascade
    from hysim.models.coleman_hodgdon import ColemanHodgdon as ColemanHodgdon
    from hysim.models.creep import Creep as Creep
    from hysim.models.custom import CustomLaw as CustomLaw
    from hysim.models.dahl import Dahl as Dahl
    from hysim.models.dashpot import Dashpot as Dashpot
    from hysim.models.duhem import Duhem as Duhem
    from hysim.models.generalized_boucwen import GeneralizedBoucWen as GeneralizedBoucWen
    from hysim.models.generalized_prandtl_ishlinskii import (
        GeneralizedPrandtlIshlinskii as GeneralizedPrandtlIshlinskii,
    )
    from hysim.models.law import Law as Law
    from hysim.models.limit_cycle import LimitCycle as LimitCycle
    from hysim.models.maxwell_slip import MaxwellSlip as MaxwellSlip
    from hysim.models.model import family as family
    from hysim.models.modes import Modes as Modes
    from hysim.models.modes import mode as mode
    from hysim.models.modified_prandtl_ishlinskii import ModifiedPrandtlIshlinskii as ModifiedPrandtlIshlinskii
    from hysim.models.oscillator import BoucWenOscillator as BoucWenOscillator
    from hysim.models.parameters import Parameter as Parameter
    from hysim.models.play import Play as Play
    from hysim.models.play import Stop as Stop
    from hysim.models.polynomial_boucwen import PolynomialBoucWen as PolynomialBoucWen
    from hysim.models.prandtl_ishlinskii import PrandtlIshlinskii as PrandtlIshlinskii
    from hysim.models.preisach import Preisach as Preisach
    from hysim.models.preisach import PreisachRelays as PreisachRelays
    from hysim.models.rate_dependent_prandtl_ishlinskii import (
        RateDependentPrandtlIshlinskii as RateDependentPrandtlIshlinskii,
    )
    from hysim.models.sensor import Sensor as Sensor
    from hysim.models.state_space import StateSpace as StateSpace
    from hysim.models.static import Line as Line
    from hysim.models.static import SingleValued as SingleValued
    from hysim.models.storage import load_model as load_model
    from hysim.models.storage import save as save
    from hysim.models.sum import Sum as Sum
    from hysim.models.transfer_function import TransferFunction as TransferFunction
    from hysim.models.zhu_wang_boucwen import ZhuWangBoucWen as ZhuWangBoucWen
    from hysim.records import Record as Record
    from hysim.simulation import Simulation as Simulation
    from hysim.simulation import simulate as simulate
    from hysim.sweeps import Sample as Sample
    from hysim.sweeps import SobolIndices as SobolIndices
    from hysim.sweeps import Sweep as Sweep
    from hysim.sweeps import load_sweep as load_sweep
    from hysim.sweeps import response_task as response_task
    from hysim.sweeps import sobol_indices as sobol_indices
    from hysim.sweeps import sweep as sweep
else:

    def __getattr__(name: str) -> Any:
        if name in MODULES:
            value = importlib.import_module(f"hysim.{name}")
        elif name in HOME:
            value = getattr(importlib.import_module(HOME[name]), name)
        else:
            raise AttributeError(f"module 'hysim' has no attribute {name!r}")
        globals()[name] = value
        return value

    def __dir__() -> list[str]:
        return sorted(__all__)
