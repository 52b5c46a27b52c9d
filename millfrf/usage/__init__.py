"""What is typed: examples in every help, lists of numbers, and mistakes in our words."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
