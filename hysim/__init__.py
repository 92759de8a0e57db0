"""hysim: simulate, identify, discover, compensate and compare hysteretic actuators.

The names below are the whole public face, in reading order. They are loaded when first used: the bare
import costs the standard library only.
"""

import importlib
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

_MODULES = ("benchmarks", "control", "datasets", "metrics", "plot", "rig", "signals", "vision")
_HOME = {
    "Record": "hysim.records",
    "load": "hysim.files",
    "save_record": "hysim.files",
    "simulate": "hysim.simulation",
    "Simulation": "hysim.simulation",
    "identify": "hysim.identification",
    "Identification": "hysim.identification",
    "select": "hysim.identification",
    "Selection": "hysim.identification",
    "discover": "hysim.discovery",
    "Discovery": "hysim.discovery",
    "PID": "hysim.control",
    "TrackingController": "hysim.control",
    "InverseFeedforward": "hysim.control",
    "ModeInverse": "hysim.control",
    "Shaper": "hysim.control",
    "Notch": "hysim.control",
    "DampingLoop": "hysim.control",
    "close_loop": "hysim.control",
    "ClosedLoop": "hysim.control",
    "tune": "hysim.control",
    "Tuning": "hysim.control",
    "to_c": "hysim.control",
    "CSource": "hysim.control",
    "to_control": "hysim.control",
    "compare": "hysim.comparison",
    "Comparison": "hysim.comparison",
    "sweep": "hysim.sweeps",
    "Sweep": "hysim.sweeps",
    "Sample": "hysim.sweeps",
    "response_task": "hysim.sweeps",
    "load_sweep": "hysim.sweeps",
    "sobol_indices": "hysim.sweeps",
    "SobolIndices": "hysim.sweeps",
    "loop_metrics": "hysim.metrics",
    "LoopMetrics": "hysim.metrics",
    "cycle_metrics": "hysim.metrics",
    "CycleMetrics": "hysim.metrics",
    "BoucWen": "hysim.models.boucwen",
    "PolynomialBoucWen": "hysim.models.polynomial_boucwen",
    "ZhuWangBoucWen": "hysim.models.zhu_wang_boucwen",
    "GeneralizedBoucWen": "hysim.models.generalized_boucwen",
    "BoucWenBaberNoori": "hysim.models.baber_noori",
    "BoucWenInverse": "hysim.models.boucwen_inverse",
    "LimitCycle": "hysim.models.limit_cycle",
    "Duhem": "hysim.models.duhem",
    "PrandtlIshlinskii": "hysim.models.prandtl_ishlinskii",
    "ModifiedPrandtlIshlinskii": "hysim.models.modified_prandtl_ishlinskii",
    "GeneralizedPrandtlIshlinskii": "hysim.models.generalized_prandtl_ishlinskii",
    "RateDependentPrandtlIshlinskii": "hysim.models.rate_dependent_prandtl_ishlinskii",
    "Play": "hysim.models.play",
    "Stop": "hysim.models.play",
    "MaxwellSlip": "hysim.models.maxwell_slip",
    "Preisach": "hysim.models.preisach",
    "PreisachRelays": "hysim.models.preisach",
    "Dahl": "hysim.models.dahl",
    "ColemanHodgdon": "hysim.models.coleman_hodgdon",
    "Sum": "hysim.models.sum",
    "Cascade": "hysim.models.cascade",
    "Dashpot": "hysim.models.dashpot",
    "CustomLaw": "hysim.models.custom",
    "BoucWenOscillator": "hysim.models.oscillator",
    "TransferFunction": "hysim.models.transfer_function",
    "StateSpace": "hysim.models.state_space",
    "Modes": "hysim.models.modes",
    "mode": "hysim.models.modes",
    "Creep": "hysim.models.creep",
    "Amplifier": "hysim.models.amplifier",
    "Sensor": "hysim.models.sensor",
    "Actuator": "hysim.models.actuator",
    "Line": "hysim.models.static",
    "SingleValued": "hysim.models.static",
    "save": "hysim.models.storage",
    "load_model": "hysim.models.storage",
    "SimulationError": "hysim.errors",
    "show_versions": "hysim._versions",
}

__all__ = ["__version__", *_MODULES, *_HOME]

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
    from hysim.discovery import discover as discover
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
    from hysim.models.limit_cycle import LimitCycle as LimitCycle
    from hysim.models.maxwell_slip import MaxwellSlip as MaxwellSlip
    from hysim.models.modes import Modes as Modes
    from hysim.models.modes import mode as mode
    from hysim.models.modified_prandtl_ishlinskii import ModifiedPrandtlIshlinskii as ModifiedPrandtlIshlinskii
    from hysim.models.oscillator import BoucWenOscillator as BoucWenOscillator
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
        if name in _MODULES:
            value = importlib.import_module(f"hysim.{name}")
        elif name in _HOME:
            value = vars(importlib.import_module(_HOME[name]))[name]
        else:
            raise AttributeError(f"module 'hysim' has no attribute {name!r}")
        globals()[name] = value
        return value

    def __dir__() -> list[str]:
        return sorted(__all__)
