"""Whole tool paths: places of the cut, postures that reach them, and the best continuous sequence of postures."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
