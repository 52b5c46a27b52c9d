"""A whole run: the campaign opened, its dry run in words, the run itself, and what it leaves beside the results."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
