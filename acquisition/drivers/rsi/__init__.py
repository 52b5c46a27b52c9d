"""KUKA's Robot Sensor Interface: joint angles, position and motor currents every 4 or 12 ms, through UDP."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
