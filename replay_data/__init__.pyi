from .cells import HammerCell, MillingCell
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
)
from .joints import tip_motion
from .laboratory import (
    ACETAL_CUTTER,
    SWEEP_IMMERSIONS,
    Sensor,
    cutting_table,
    dynamometer,
    hammer_sensors,
    housing_accelerometers,
    milling_sensors,
    setup_text,
    tip_accelerometers,
)
from .milling_loop import Settling, settle
from .robot_structure import default_structure, posture_robot, select, table_one_model, tip_model
from .speed_profiles import ConstantSpeed, LinearSweep, RepeatedSweep, SpeedProfile

__all__ = [
    "ACETAL_CUTTER",
    "FINE_RATE",
    "FOREIGN",
    "LEVELS",
    "SWEEP_IMMERSIONS",
    "ConcealedCell",
    "ConcealedEffect",
    "ConstantSpeed",
    "HammerCell",
    "LinearSweep",
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
