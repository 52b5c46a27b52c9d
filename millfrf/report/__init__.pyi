from .collection import Collected, collect
from .diagnoses import left_in_words, write_cut_report, write_diagnosis_report, write_robot_report
from .page import ReportOptions, write_report
from .pages import (
    FigureFiles,
    ResultsPage,
    asked_figures,
    page_text,
    write_figures,
    write_results_page,
    write_results_pdf,
)
from .section import Fold, Picture, Section, picture_of

__all__ = [
    "Collected",
    "FigureFiles",
    "Fold",
    "Picture",
    "ReportOptions",
    "ResultsPage",
    "Section",
    "asked_figures",
    "collect",
    "left_in_words",
    "page_text",
    "picture_of",
    "write_cut_report",
    "write_diagnosis_report",
    "write_figures",
    "write_report",
    "write_results_page",
    "write_results_pdf",
    "write_robot_report",
]
