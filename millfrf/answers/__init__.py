"""Results as numbers for a script: the fields of what `--json` prints, with units at the end of their names."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
