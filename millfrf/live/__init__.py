"""The live page: a recording drawn in a browser while it grows. What is drawn is thinned out, the file is not."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
