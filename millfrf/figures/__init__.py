"""Figures for reports and publications: each function returns a figure and writes no file."""

from millfrf.lazy_front import lazy_front

__getattr__, __dir__ = lazy_front(__name__, __file__)
