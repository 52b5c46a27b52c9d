"""Figures a researcher would publish: each function returns a matplotlib figure and touches no file.

The report, the notebook and the examples share them. The front is lazy: a name loads its file when it is first used.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
