"""What modes do with the level of excitation, told without any law: frequency, damping, and the family of physics."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
