"""The simulated laboratory: sensors, signal chain, and the set-up that it notes down."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
