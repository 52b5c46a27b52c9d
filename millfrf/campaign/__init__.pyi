from .graph import Task, key_of
from .results import MeasuredSet, write_summary

__all__ = ["MeasuredSet", "Task", "key_of", "write_summary"]
