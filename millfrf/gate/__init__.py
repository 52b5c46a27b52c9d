"""The gate decides whether inputs make sense for a step.

A function ``check_...`` raises :class:`millfrf.core.InputError` (one line: the value and the remedy) where the step
cannot be done with what is given, and returns doubts: sentences that a command prints as warnings and stores with the
result.
"""

from millfrf.lazy_front import lazy_front

__getattr__, __dir__ = lazy_front(__name__, __file__)
