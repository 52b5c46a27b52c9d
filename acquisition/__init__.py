"""Channels, recordings and the sources they come from: knows nothing of spectra or models."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
