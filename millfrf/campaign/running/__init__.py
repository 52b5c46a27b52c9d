"""Running a campaign: the store of results, one task, the executors, what is kept for the next run."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
