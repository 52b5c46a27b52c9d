"""`millfrf robot learn` and what `--learned` does in other commands: measured modes over postures."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
