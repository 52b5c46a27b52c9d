"""Mode indicators: where an FRF matrix shows modes, before and beside any fit."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
