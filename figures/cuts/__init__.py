"""Figures of cuts: stability lobes, and spectra of cuts that were judged."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
