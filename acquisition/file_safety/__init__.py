"""What keeps a recording file safe: syncs and locks while it is written, and careful reading of damaged files."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
