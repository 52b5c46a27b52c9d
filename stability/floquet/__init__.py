"""The tooth period as an operator, its Floquet multipliers, and the depths at which cuts grow."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
