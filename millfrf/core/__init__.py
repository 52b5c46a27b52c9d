"""Units, degrees of freedom, checked tables, whole files, results; knows no physics of machining."""

from millfrf.lazy_front import lazy_front

__getattr__, __dir__ = lazy_front(__name__, __file__)
