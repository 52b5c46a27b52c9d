from .geometry import Geometry
from .geometry_file import GeometryTable, import_geometry, is_geometry_table, read_geometry, write_geometry

__all__ = [
    "Geometry",
    "GeometryTable",
    "import_geometry",
    "is_geometry_table",
    "read_geometry",
    "write_geometry",
]
