"""Where the points of a measurement lie and along which directions they are measured: what mode shapes are drawn on."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
