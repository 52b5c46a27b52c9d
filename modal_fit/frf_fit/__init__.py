"""Modal models of FRF matrices by variable projection: selection, refinement and error bars."""

from .fit import NOT_REFINED, REFINED, MatrixFit, fit_matrix
from .mode_selection.steady_poles import default_order

__all__ = ["NOT_REFINED", "REFINED", "MatrixFit", "default_order", "fit_matrix"]
