"""Causes ranked without a fit, and the fits of those that promise most."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
