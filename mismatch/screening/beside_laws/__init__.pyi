from .beside_free_forms import Gains, gains_beside_laws
from .free_form import FreeForm, families, with_free_forms

__all__ = ["FreeForm", "Gains", "families", "gains_beside_laws", "with_free_forms"]
