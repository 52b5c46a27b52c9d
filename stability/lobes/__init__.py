"""Results of a stability analysis: lobes over spindle speed, all limits at one speed, and their files."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
