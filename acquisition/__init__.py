"""Channels, recordings and the sources they come from: knows nothing of spectra or models."""

from millfrf.lazy_front import lazy_front

__getattr__, __dir__ = lazy_front(__name__, __file__)
