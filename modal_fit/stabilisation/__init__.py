"""Poles over model order by a right matrix fraction, and the stabilisation chart that chooses among them."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
