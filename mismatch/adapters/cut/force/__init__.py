"""The cutting force that a process gives along a recording, its spectra and their noise."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
