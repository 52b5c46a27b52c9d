"""The comparison of a structure with recordings on the command line: files in, a folder of results out."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
