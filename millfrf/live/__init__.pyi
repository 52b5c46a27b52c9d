from .control import MARKS, LiveControl
from .monitor import LiveMonitor, LiveSettings
from .server import LOOPBACK, LiveServer

__all__ = [
    "LOOPBACK",
    "MARKS",
    "LiveControl",
    "LiveMonitor",
    "LiveServer",
    "LiveSettings",
]
