"""Poles that somebody picks: the file that offers candidates, the file that names the choice, and the fit of it."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
