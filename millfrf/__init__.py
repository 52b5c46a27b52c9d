"""The Python face, ``import millfrf as mf``: by name what the command line does, and the types that it gives.

The front is lazy: a name loads its file when it is first used, so that the import itself takes milliseconds.
"""

import lazy_loader

from .hidden_packages import refuse_hidden_packages

refuse_hidden_packages()

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
