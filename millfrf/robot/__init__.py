"""The robot models on the command line: commands, pictures, an interactive page, maps of depth limits."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
