"""What drifts, with what, and which sets and recordings stand off, with false alarms held to 5 % of campaigns."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
