from .cut_diagnosis_page import write_cut_report
from .diagnosis_page import write_diagnosis_report
from .robot_diagnosis_page import write_robot_report

__all__ = [
    "write_cut_report",
    "write_diagnosis_report",
    "write_robot_report",
]
