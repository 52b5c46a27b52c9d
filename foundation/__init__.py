"""Foundation of every room: named errors, whole-file writing, units and degrees of freedom.

Nothing here knows about signals, models or the command line.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
