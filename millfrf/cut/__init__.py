"""The cutting process on the command line: which physics a computed cutting force leaves out."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
