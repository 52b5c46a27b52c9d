"""Robots as data: from posture to stiffness, modes, receptance and deviation; knows nothing of recordings."""

from millfrf.lazy_front import lazy_front

__getattr__, __dir__ = lazy_front(__name__, __file__)
