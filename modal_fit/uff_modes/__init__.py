"""Mode shapes in the Universal File Format, data set 55, with any number of points."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
