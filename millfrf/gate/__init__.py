"""The gate: one place decides whether what is given makes sense for a job.

A function ``check_...`` raises :class:`foundation.InputError` (one line: the value and the remedy) where the job cannot
be done with what is given, and returns doubts: sentences that a command prints as warnings and stores with the result.
"""

from .inputs import check_inputs, check_records, driven_lines
from .recordings import check_recordings

__all__ = ["check_inputs", "check_recordings", "check_records", "driven_lines"]
