from .measured_set import MeasuredSet
from .summary import write_summary

__all__ = ["MeasuredSet", "write_summary"]
