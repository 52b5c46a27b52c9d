"""Faults of a recording itself: tones from elsewhere and channels that saturate."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
