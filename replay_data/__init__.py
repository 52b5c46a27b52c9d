"""The simulated robot cell and its recordings: knows nothing of fitting or diagnosis."""

from millfrf.lazy_front import lazy_front

__getattr__, __dir__ = lazy_front(__name__, __file__)
