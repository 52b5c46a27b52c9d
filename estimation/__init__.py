"""Spectra, coherence and frequency response functions from recordings: knows nothing of modes."""

from millfrf.lazy_front import lazy_front

__getattr__, __dir__ = lazy_front(__name__, __file__)
