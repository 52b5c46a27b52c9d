"""`Frf`, the matrix of frequency response functions: its quantity, its known band and its files."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
