"""Depth limits that were verified with Floquet multipliers, and what is done where two methods disagree."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
