"""Error bars of stability limits: sensitivities, drawn samples, and the interval that holds the true limit."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
