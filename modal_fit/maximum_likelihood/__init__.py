"""Maximum-likelihood modal parameters from whole records, with noise on forces and responses."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
