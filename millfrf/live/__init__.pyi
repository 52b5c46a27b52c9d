from .control import MARKS, LiveControl
from .monitor import LiveMonitor, LiveSettings
from .web import LOOPBACK, LiveServer

__all__ = [
    "LOOPBACK",
    "MARKS",
    "LiveControl",
    "LiveMonitor",
    "LiveServer",
    "LiveSettings",
]
