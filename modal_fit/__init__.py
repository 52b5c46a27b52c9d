"""Modal models, their fitting and the calibration to the tool tip: knows nothing of cutting."""

from millfrf.lazy_front import lazy_front

__getattr__, __dir__ = lazy_front(__name__, __file__)
