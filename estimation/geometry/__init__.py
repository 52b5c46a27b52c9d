"""Where the points of a measurement lie and along which directions they are measured: what mode shapes are drawn on."""

from .geometry import Geometry
from .geometry_file import import_geometry, is_geometry_table, read_geometry, write_geometry

__all__ = ["Geometry", "import_geometry", "is_geometry_table", "read_geometry", "write_geometry"]
