from .control import MARKS, LiveControl
from .monitor import LiveMonitor, LiveSettings
from .session import SessionPlan, SessionTests, session_plan
from .web import LOOPBACK, CountedServer, Guard, Guarded, Limits, LiveServer, Missing, hosts_of

__all__ = [
    "LOOPBACK",
    "MARKS",
    "CountedServer",
    "Guard",
    "Guarded",
    "Limits",
    "LiveControl",
    "LiveMonitor",
    "LiveServer",
    "LiveSettings",
    "Missing",
    "SessionPlan",
    "SessionTests",
    "hosts_of",
    "session_plan",
]
