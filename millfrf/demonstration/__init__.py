"""The demonstration on the simulated cell: the whole chain, and the blind diagnosis of a concealed effect."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
