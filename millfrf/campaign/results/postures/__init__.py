"""The posture model of a campaign: does it hold at poses that were left out, and which pose contradicts it?"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
