"""Poles picked in the browser: a stabilisation chart, the synthesis beside it, and a file of the choice."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
