"""Tasks of a campaign: what there is to do, what needs what, and the key of each result."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
