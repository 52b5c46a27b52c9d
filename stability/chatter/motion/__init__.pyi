from .course import Course, course_of
from .envelope import Envelope, envelope_of
from .evidence import Evidence, gather_evidence
from .families import SHARP, TOLERANCE, Family, largest_motion
from .irregular import irregular_change
from .lines import Line
from .teeth import alternating_change, alternation, alternation_course
from .tool_motion import ToolMotion

__all__ = [
    "SHARP",
    "TOLERANCE",
    "Course",
    "Envelope",
    "Evidence",
    "Family",
    "Line",
    "ToolMotion",
    "alternating_change",
    "alternation",
    "alternation_course",
    "course_of",
    "envelope_of",
    "gather_evidence",
    "irregular_change",
    "largest_motion",
]
