"""The page's web server: who may come in, what goes out, and no more of either than was planned."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
