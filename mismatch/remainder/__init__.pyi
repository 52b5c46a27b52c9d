from .beyond_modes import beyond_model
from .bursts import Bursts, bursts_left
from .moving_part import leftover
from .response_share import share_of_response

__all__ = [
    "Bursts",
    "beyond_model",
    "bursts_left",
    "leftover",
    "share_of_response",
]
