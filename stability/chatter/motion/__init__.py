"""Evidence in the recording of a cut: the spindle's angle, orders, lines, how they vary, and the chip."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
