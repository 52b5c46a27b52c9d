"""Figures of modal models: vectors, shapes, stabilisation charts, indicators and synthesis."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
