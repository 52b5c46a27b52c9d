"""The step from recordings of hammer tests to one FRF file: points, judged taps, windows, averages."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
