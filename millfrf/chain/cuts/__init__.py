"""What a model or a recording says of a cut: stability lobes and chatter verdicts."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
