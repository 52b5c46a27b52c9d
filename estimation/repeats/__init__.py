"""Noise, distortion and homogeneity from forces that repeat, and noise where they do not: no model is needed."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
