"""Modes of a posture: as modelled, corrected by factors, and measured; and which of them are the same."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
