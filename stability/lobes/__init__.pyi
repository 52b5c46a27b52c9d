from .lobes_file import read_lobes, write_lobes
from .stability_limits import StabilityLimits
from .stability_lobes import STATUSES, StabilityLobes

__all__ = [
    "STATUSES",
    "StabilityLimits",
    "StabilityLobes",
    "read_lobes",
    "write_lobes",
]
