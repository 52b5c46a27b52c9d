"""`millfrf robot path`: depth limits and deviation along a tool path, and the postures that are best for it."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
