"""Where a model and recordings disagree: locate it, name the physics, model it, show the fit improve."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
