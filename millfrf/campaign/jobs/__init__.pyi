from .every_job import JOB_OF
from .work import Outcome, Work

__all__ = ["JOB_OF", "Outcome", "Work"]
