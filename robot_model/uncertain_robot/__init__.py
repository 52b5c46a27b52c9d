"""A robot whose numbers are uncertain: written to its file after an update, and carried into bands."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
