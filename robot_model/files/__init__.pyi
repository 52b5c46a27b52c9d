from .changed_file import (
    changed_robot_text,
)
from .numbered_text import (
    numbered_robot_text,
)
from .planar_file import PlanarCase, PlanarFile, read_planar_robot
from .robot_files import (
    assumptions,
    read_table,
    robot_names,
    robot_text,
)
from .serial_file import SerialFile, read_serial_robot
from .spatial_file import SpatialCase, read_spatial_robot
from .spatial_tables import SpatialFile

__all__ = [
    "PlanarCase",
    "PlanarFile",
    "SerialFile",
    "SpatialCase",
    "SpatialFile",
    "assumptions",
    "changed_robot_text",
    "numbered_robot_text",
    "read_planar_robot",
    "read_serial_robot",
    "read_spatial_robot",
    "read_table",
    "robot_names",
    "robot_text",
]
