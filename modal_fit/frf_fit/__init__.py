"""Modal models of FRF matrices by variable projection: selection, refinement and error bars."""

from .fit import NOT_REFINED, REFINED, MatrixFit, fit_matrix
from .mode_selection.candidates import default_order

__all__ = ["NOT_REFINED", "REFINED", "MatrixFit", "default_order", "fit_matrix"]
