"""Parameters of a robot from measured FRFs, frequencies or deflections, with standard errors."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
