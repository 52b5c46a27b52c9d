"""Serial robots as joints and rigid bodies: read from URDF or DH tables, written to files, made into robots."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
