from .beyond_modes import beyond_model
from .leftover_test import leftover

__all__ = [
    "beyond_model",
    "leftover",
]
