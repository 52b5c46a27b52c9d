from .live_session import acquire_live
from .plan import PlanTable, plan_from_file, plan_tables
from .record_session import OpenedSession, Tally, acquire, open_session
from .signal_check import listen, preflight

__all__ = [
    "OpenedSession",
    "PlanTable",
    "Tally",
    "acquire",
    "acquire_live",
    "listen",
    "open_session",
    "plan_from_file",
    "plan_tables",
    "preflight",
]
