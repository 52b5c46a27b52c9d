"""Stability lobes from modal models and measured FRFs; knows nothing of acquisition hardware."""

from millfrf.lazy_front import lazy_front

__getattr__, __dir__ = lazy_front(__name__, __file__)
