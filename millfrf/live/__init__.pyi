from .control import MARKS, LiveControl
from .monitor import LiveMonitor, LiveSettings
from .session import SessionPlan, SessionTests, session_plan
from .web import LOOPBACK, LiveServer

__all__ = [
    "LOOPBACK",
    "MARKS",
    "LiveControl",
    "LiveMonitor",
    "LiveServer",
    "LiveSettings",
    "SessionPlan",
    "SessionTests",
    "session_plan",
]
