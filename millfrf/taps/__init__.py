"""From recordings of hammer tests to one FRF file: which point was hit where, taps judged, windows, averages."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
