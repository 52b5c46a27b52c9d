"""Integration in time: modal structures, joint laws, the regenerative milling loop and its material."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
