"""Variable projection on the measured lines: linear unknowns eliminated, poles and left vectors refined."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
