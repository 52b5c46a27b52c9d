"""Which mode of one set is which mode of another: within a pose by shape and frequency, over poses by neighbours."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
