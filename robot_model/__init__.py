"""Robots as data: posture to stiffness, modes, receptance and deviation; knows nothing of recordings."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
