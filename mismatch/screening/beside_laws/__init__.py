"""Whether a further cause is one beside a joint's law, or mends the form of that law."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
