"""Recordings reduced to a band: matched channels, one resampling, one set of motion quantities, windowed spectra."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
