"""The modal-fitting report: one self-contained page that a laboratory attaches to its test sheet."""

from .collection import Collected, collect
from .page import ReportOptions, write_report

__all__ = ["Collected", "ReportOptions", "collect", "write_report"]
