"""A campaign on a simulated robot cell: recordings with things hidden in them, and their truth."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
