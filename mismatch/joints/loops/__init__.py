"""Loops over the instants of a simulation, of its tangent, and of modal filters. Compiled."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
