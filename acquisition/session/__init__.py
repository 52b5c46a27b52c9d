"""Sessions: a TOML file that says what is wired where, checked where it enters, and the source it describes."""

from .build import build_source
from .read import read_session
from .tables import Session

__all__ = ["Session", "build_source", "read_session"]
