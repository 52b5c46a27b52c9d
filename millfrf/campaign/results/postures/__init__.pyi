from .coverage import Contradiction, PostureCoverage, coverage_of
from .coverage_figure import draw_coverage
from .coverage_section import FILE, contradiction_words, posture_section

__all__ = [
    "FILE",
    "Contradiction",
    "PostureCoverage",
    "contradiction_words",
    "coverage_of",
    "draw_coverage",
    "posture_section",
]
