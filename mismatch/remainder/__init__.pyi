from .beyond_modes import beyond_model
from .moving_part import leftover

__all__ = [
    "beyond_model",
    "leftover",
]
