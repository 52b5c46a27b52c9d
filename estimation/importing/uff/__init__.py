"""FRFs of Universal File Format files, with their coherences and units."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
