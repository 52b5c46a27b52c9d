"""One driver a file; each is a `Source`."""

from .replay import ReplaySource

__all__ = ["ReplaySource"]
