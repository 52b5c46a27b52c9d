"""Spectra, coherence and frequency response functions from recordings: knows nothing of modes."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
