"""What predicts after a diagnosis: the last fit, the improved model, and receptances for the lobes."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
