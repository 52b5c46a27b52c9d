"""The gate: one place decides whether what is given makes sense for a job.

A function ``check_...`` raises :class:`millfrf.core.InputError` (one line: the value and the remedy) where the job
cannot
be done with what is given, and returns doubts: sentences that a command prints as warnings and stores with the result.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
