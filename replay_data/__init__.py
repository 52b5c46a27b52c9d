"""The simulated robot cell and its recordings: knows nothing of fitting or diagnosis."""

from .hammer_cell import HammerCell
from .laboratory.sensors import (
    Sensor,
    dynamometer,
    hammer_sensors,
    housing_accelerometers,
    milling_sensors,
    tip_accelerometers,
)
from .milling_cell import MillingCell
from .robot_structure import default_structure, table_one_model, tip_model
from .simulation.material import Material
from .simulation.settling import Settling, settle
from .speed_profiles import ConstantSpeed, DriftingSpeed, LinearSweep, SpeedProfile

__all__ = [
    "ConstantSpeed",
    "DriftingSpeed",
    "HammerCell",
    "LinearSweep",
    "Material",
    "MillingCell",
    "Sensor",
    "Settling",
    "SpeedProfile",
    "default_structure",
    "dynamometer",
    "hammer_sensors",
    "housing_accelerometers",
    "milling_sensors",
    "settle",
    "table_one_model",
    "tip_accelerometers",
    "tip_model",
]
