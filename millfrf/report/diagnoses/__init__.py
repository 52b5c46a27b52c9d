"""Report pages of the diagnoses: structure, robot, and cutting process."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
