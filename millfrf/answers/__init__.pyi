from .files import inspected, plan_answer, stored_answer, tables_answer
from .limits import cuts_answer, lobes_answer
from .models import frf_answer, model_answer

__all__ = [
    "cuts_answer",
    "frf_answer",
    "inspected",
    "lobes_answer",
    "model_answer",
    "plan_answer",
    "stored_answer",
    "tables_answer",
]
