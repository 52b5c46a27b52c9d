"""Natural frequencies and damping ratios that move with the level of the forces, by a linear fit of each level."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
