"""What a modal model gives at lines, and products of small matrices line by line."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
