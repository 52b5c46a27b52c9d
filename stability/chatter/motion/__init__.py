"""What the recording of a cut holds: the spindle's angle, orders, lines, how they vary, what they do to the chip."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
