from .cut_diagnosis_page import write_cut_report
from .diagnosis_page import write_diagnosis_report
from .left_words import left_in_words
from .robot_diagnosis_page import write_robot_report

__all__ = [
    "left_in_words",
    "write_cut_report",
    "write_diagnosis_report",
    "write_robot_report",
]
