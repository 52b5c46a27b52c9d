"""Checks whether inputs make sense for a step.

A function ``check_...`` raises :class:`millfrf.core.InputError` (one line: the value and the remedy) where the step
cannot work with its inputs, and returns warnings: sentences that a command prints and stores with the result.
"""

from millfrf.lazy_front import lazy_front

__getattr__, __dir__ = lazy_front(__name__, __file__)
