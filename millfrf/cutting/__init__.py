"""Milling and drilling forces, and directional coefficients; knows nothing of structures."""

from millfrf.lazy_front import lazy_front

__getattr__, __dir__ = lazy_front(__name__, __file__)
