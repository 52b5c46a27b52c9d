"""Model updating: single changes of a robot's model, weighed against frequencies found at several postures."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
