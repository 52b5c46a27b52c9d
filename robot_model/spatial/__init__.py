"""Robots in space: structure at a posture, modes, weight, a compliant tool, and natural coordinates."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
