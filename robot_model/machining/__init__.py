"""What a robot does to a part: postures for a cut, deviation of drilled holes, its uncertainty, compensated paths."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
