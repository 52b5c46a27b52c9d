from .collection import Collected, collect
from .diagnoses import write_cut_report, write_diagnosis_report, write_robot_report
from .page import ReportOptions, write_report

__all__ = [
    "Collected",
    "ReportOptions",
    "collect",
    "write_cut_report",
    "write_diagnosis_report",
    "write_report",
    "write_robot_report",
]
