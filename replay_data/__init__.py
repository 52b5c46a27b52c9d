"""The simulated robot cell and its recordings: knows nothing of fitting or diagnosis."""

from replay_data.hammer_cell import HammerCell
from replay_data.material import Material
from replay_data.milling_cell import MillingCell
from replay_data.robot_structure import default_structure, table_one_model, tip_model
from replay_data.sensors import (
    Sensor,
    dynamometer,
    hammer_sensors,
    housing_accelerometers,
    milling_sensors,
    tip_accelerometers,
)
from replay_data.speed_profiles import ConstantSpeed, DriftingSpeed, LinearSweep, SpeedProfile

__all__ = [
    "ConstantSpeed",
    "DriftingSpeed",
    "HammerCell",
    "LinearSweep",
    "Material",
    "MillingCell",
    "Sensor",
    "SpeedProfile",
    "default_structure",
    "dynamometer",
    "hammer_sensors",
    "housing_accelerometers",
    "milling_sensors",
    "table_one_model",
    "tip_accelerometers",
    "tip_model",
]
