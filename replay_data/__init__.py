"""The simulated robot cell and its recordings: knows nothing of fitting or diagnosis."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
