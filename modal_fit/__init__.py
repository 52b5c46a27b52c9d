"""Modal models, their fitting and the calibration to the tool tip: knows nothing of cutting."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
