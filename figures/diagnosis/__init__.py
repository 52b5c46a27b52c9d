"""Figures of diagnoses: where the residual lies, how it grows, the law that was found."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
