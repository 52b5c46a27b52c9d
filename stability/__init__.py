"""Stability lobes from modal models and measured FRFs: knows nothing of acquisition hardware."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
