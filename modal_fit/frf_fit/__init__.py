"""Modal models of FRF matrices by variable projection: selection, refinement and error bars."""

from .candidates import default_order
from .fit import NOT_REFINED, REFINED, MatrixFit, fit_matrix

__all__ = ["NOT_REFINED", "REFINED", "MatrixFit", "default_order", "fit_matrix"]
