"""Figures of what was measured: recordings, inputs, FRFs and their reciprocity."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
