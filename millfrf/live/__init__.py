"""The live page: a recording drawn in a browser while it grows. What is drawn is thinned out, the file is not."""

from .control import LiveControl
from .monitor import LiveMonitor, LiveSettings
from .server import LiveServer

__all__ = ["LiveControl", "LiveMonitor", "LiveServer", "LiveSettings"]
