"""Recording files: written block by block, read in blocks, aligned in time and recovered after a crash."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
