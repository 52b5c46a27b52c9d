"""Sessions: a TOML file that says what is wired where, checked where it enters, and the source it describes."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
