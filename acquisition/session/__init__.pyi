from .build import build_source
from .read import read_session, session_from_text, session_text
from .tables import Session, SimulatedDevice

__all__ = [
    "Session",
    "SimulatedDevice",
    "build_source",
    "read_session",
    "session_from_text",
    "session_text",
]
