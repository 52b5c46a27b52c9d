from .comparison import ModePair, compare_modes
from .modal_model import ModalModel
from .modal_model_file import read_modal_model, write_modal_model
from .mode_errors import ModeErrors
from .out_of_band import (
    ABOVE,
    basis_with_poles,
    fixed_pole,
    fixed_poles,
    out_of_band_basis,
    residuals_from,
    residuals_with_poles,
)
from .residuals import Residuals
from .shape_measures import modal_assurance, phase_collinearity, phase_deviation, reciprocity_residual
from .summary_of_fit import fit_summary
from .synthesised import Synthesis, synthesis
from .uncertainty import derived_covariance, frequency_and_damping_errors, pack_parameters, unpack_parameters

__all__ = [
    "ABOVE",
    "ModalModel",
    "ModeErrors",
    "ModePair",
    "Residuals",
    "Synthesis",
    "basis_with_poles",
    "compare_modes",
    "derived_covariance",
    "fit_summary",
    "fixed_pole",
    "fixed_poles",
    "frequency_and_damping_errors",
    "modal_assurance",
    "out_of_band_basis",
    "pack_parameters",
    "phase_collinearity",
    "phase_deviation",
    "read_modal_model",
    "reciprocity_residual",
    "residuals_from",
    "residuals_with_poles",
    "synthesis",
    "unpack_parameters",
    "write_modal_model",
]
