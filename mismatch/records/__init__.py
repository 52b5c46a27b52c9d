"""Recordings as a model is compared with them: the band, the samples and their windowed spectra."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
