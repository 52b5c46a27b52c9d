"""Stability solvers, one method a file, and the boundary that they trace over spindle speed."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
