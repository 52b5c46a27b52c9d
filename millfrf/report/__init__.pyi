from .collection import Collected, collect
from .diagnoses import write_cut_report, write_diagnosis_report, write_robot_report
from .page import ReportOptions, write_report
from .results_page import ResultsPage, write_results_page
from .section import Fold, Picture, Section

__all__ = [
    "Collected",
    "Fold",
    "Picture",
    "ReportOptions",
    "ResultsPage",
    "Section",
    "collect",
    "write_cut_report",
    "write_diagnosis_report",
    "write_report",
    "write_results_page",
    "write_robot_report",
]
