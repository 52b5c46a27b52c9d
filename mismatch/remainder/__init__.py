"""What a hypothesis leaves of the recordings, and whether that is noise."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
