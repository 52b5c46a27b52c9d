"""Mode shapes of a model, measured: likeness of modes, and how far each is from a real one."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
