"""Which physics a computed cutting force leaves out: measured forces of a cut against those of a cutting process."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
