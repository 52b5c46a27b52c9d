"""Sources of samples and feeds of events, and what wraps them: pacing, threads, several feeds beside one source."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
