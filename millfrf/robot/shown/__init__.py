"""A posture shown: page in the browser, pictures and tables of FRFs and stiffness."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
