"""What each kind of comparison gives to the inference: a structure, a robot, a cut."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
