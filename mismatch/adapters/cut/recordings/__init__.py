"""Recordings of cuts: forces, the tip's motion, the spindle's angle, and whether the cut chatters."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
