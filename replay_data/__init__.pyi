from .concealment import (
    FINE_RATE,
    FOREIGN,
    LEVELS,
    ConcealedCell,
    ConcealedEffect,
    draw_effect,
    draw_name,
    joint_scale,
    milling_force,
    posture_robot,
)
from .hammer_cell import HammerCell
from .laboratory import (
    Sensor,
    cutting_table,
    dynamometer,
    hammer_sensors,
    housing_accelerometers,
    milling_sensors,
    setup_text,
    tip_accelerometers,
)
from .milling_cell import MillingCell
from .robot_structure import default_structure, select, table_one_model, tip_model
from .simulation import Material, Settling, settle, tip_motion
from .speed_profiles import ConstantSpeed, DriftingSpeed, LinearSweep, RepeatedSweep, SpeedProfile

__all__ = [
    "FINE_RATE",
    "FOREIGN",
    "LEVELS",
    "ConcealedCell",
    "ConcealedEffect",
    "ConstantSpeed",
    "DriftingSpeed",
    "HammerCell",
    "LinearSweep",
    "Material",
    "MillingCell",
    "RepeatedSweep",
    "Sensor",
    "Settling",
    "SpeedProfile",
    "cutting_table",
    "default_structure",
    "draw_effect",
    "draw_name",
    "dynamometer",
    "hammer_sensors",
    "housing_accelerometers",
    "joint_scale",
    "milling_force",
    "milling_sensors",
    "posture_robot",
    "select",
    "settle",
    "setup_text",
    "table_one_model",
    "tip_accelerometers",
    "tip_model",
    "tip_motion",
]
