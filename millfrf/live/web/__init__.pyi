from .guard import Guard, Limits
from .server import LOOPBACK, LiveServer

__all__ = ["LOOPBACK", "Guard", "Limits", "LiveServer"]
