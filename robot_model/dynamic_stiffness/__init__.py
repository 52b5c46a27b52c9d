"""Exact dynamic stiffness of beams and receptance coupling: the reference for the finite elements."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
