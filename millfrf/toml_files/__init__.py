"""The TOML files that users write: each key with type, unit, range and default, as tables and as JSON schemas."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
