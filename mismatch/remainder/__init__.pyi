from .beyond_modes import beyond_model
from .moving_part import leftover
from .response_share import share_of_response

__all__ = [
    "beyond_model",
    "leftover",
    "share_of_response",
]
