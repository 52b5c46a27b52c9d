"""Disagreement between a model and recordings: located, named, modelled, and checked on held-out data."""

from millfrf.lazy_front import lazy_front

__getattr__, __dir__ = lazy_front(__name__, __file__)
