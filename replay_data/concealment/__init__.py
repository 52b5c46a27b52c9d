"""Milling tests of a simulated robot that hides one effect, for blind trials of the diagnosis."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
