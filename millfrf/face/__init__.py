"""The functions that a notebook and the command line both call: one verb a function, a typed result each.

A function takes files by name, or what an earlier one returned. It computes and returns; it writes no file and prints
nothing. ``import millfrf as mf`` offers each by its name.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
