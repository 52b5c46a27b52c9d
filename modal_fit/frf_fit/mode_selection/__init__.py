"""Which modes a band needs: candidates, a trial of each, and modes that the residual still hides."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
