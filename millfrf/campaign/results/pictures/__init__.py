"""Pictures of a campaign: maps over poses, trends, and what the posture model says of poses that were left out."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
