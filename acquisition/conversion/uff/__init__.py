"""Data sets of Universal File Format files, read line by line or with pyuff."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
