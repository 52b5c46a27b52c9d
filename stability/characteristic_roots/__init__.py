"""Roots of the characteristic function: all depths and frequencies at which a multiplier crosses the unit circle."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
