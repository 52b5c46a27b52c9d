"""From hypotheses to a verdict. Nothing here knows of structures, robots or cuts."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
