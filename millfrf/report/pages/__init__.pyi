from .figures_written import FigureFiles, asked_figures, write_figures
from .paper import write_results_pdf
from .results_page import ResultsPage, page_text, write_results_page

__all__ = [
    "FigureFiles",
    "ResultsPage",
    "asked_figures",
    "page_text",
    "write_figures",
    "write_results_page",
    "write_results_pdf",
]
