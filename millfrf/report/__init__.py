"""The modal-fitting report: one self-contained page that a laboratory attaches to its test sheet."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
