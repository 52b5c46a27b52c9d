"""What `millfrf new` makes: files from what was read and what was typed."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
