from .lines import UffLines, read_uff_lines
from .sets import read_uff_sets

__all__ = [
    "UffLines",
    "read_uff_lines",
    "read_uff_sets",
]
