"""The regenerative milling loop: tip receptance, delayed state equation, and which teeth cut when."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
