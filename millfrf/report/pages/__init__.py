"""The one form of all HTML reports: page, style, behaviour, and its figures as files."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
