"""Full update: all numbers of a robot together, from FRFs and modal models at one posture or many."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
