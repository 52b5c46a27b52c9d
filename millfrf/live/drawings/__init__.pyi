from .drawing import Choice, Drawing, as_json, number, plain
from .page_drawings import all_drawings, first_choice, names_of, roles

__all__ = ["Choice", "Drawing", "all_drawings", "as_json", "first_choice", "names_of", "number", "plain", "roles"]
