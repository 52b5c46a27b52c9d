"""Reciprocity: does a force at q move p as a force at p moves q?"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
