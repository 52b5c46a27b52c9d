"""Robots as data: TOML files of planar and spatial robots, checked where they enter."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
