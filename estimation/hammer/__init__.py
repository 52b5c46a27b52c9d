"""Hammer tests: taps found and judged, windowed, averaged, and merged to one FRF matrix by points hit and measured."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
