"""Finite elements of a robot: sections, beams, matrices, gravity, constraints, damping and reduction to modes."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
