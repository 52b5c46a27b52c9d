"""Judgement of a recording's samples by themselves, in one pass over the file."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
