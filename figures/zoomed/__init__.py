"""Figures that zoom and tell values under the pointer, for pages: bokeh draws them in the browser."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
