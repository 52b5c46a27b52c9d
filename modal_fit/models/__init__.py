"""`ModalModel` and what is computed from it: files, error bars, shape measures, synthesis, comparison."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
