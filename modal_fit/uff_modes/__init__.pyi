from .reading import import_modes_uff, read_modes_uff
from .writing import write_modes_uff

__all__ = [
    "import_modes_uff",
    "read_modes_uff",
    "write_modes_uff",
]
