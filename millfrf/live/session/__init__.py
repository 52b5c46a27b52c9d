"""The tests of a session: those recorded before, the plan that they follow, and what of it is still missing."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
