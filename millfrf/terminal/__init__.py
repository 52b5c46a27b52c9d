"""The terminal: text of files and users is shown as it stands, never read as markup."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
