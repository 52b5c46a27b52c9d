"""Modal models, their fitting and the calibration to the tool tip: knows nothing of cutting."""

from .indicators import (
    ComplexModeIndicator,
    IndicatorPeak,
    MultivariateModeIndicator,
    complex_mode_indicator,
    multivariate_mode_indicator,
)
from .models.comparison import ModePair, compare_modes
from .models.modal_model import ModalModel, Residuals
from .models.modal_model_file import read_modal_model, write_modal_model
from .models.mode_errors import ModeErrors
from .models.shape_measures import modal_assurance, phase_collinearity, phase_deviation, reciprocity_residual
from .models.synthesised import Synthesis, synthesis
from .models.uncertainty import derived_covariance, frequency_and_damping_errors
from .pole_picking import (
    CandidateGroup,
    candidate_groups,
    fit_picked_poles,
    read_picked_poles,
    read_pole_groups,
    write_pole_candidates,
)
from .polyreference import ModalFit, fit_polyreference
from .shapes import ModeReciprocity, ModeShapes, mode_complexity, mode_reciprocity, mode_shapes
from .stabilisation.chart import PoleGroup, StabilisationChart
from .subspace import SubspaceFit, fit_subspace
from .tip_calibration import TipCalibration, calibrate_to_tip
from .uff_modes import import_modes_uff, read_modes_uff, write_modes_uff

__all__ = [
    "CandidateGroup",
    "ComplexModeIndicator",
    "IndicatorPeak",
    "ModalFit",
    "ModalModel",
    "ModeErrors",
    "ModePair",
    "ModeReciprocity",
    "ModeShapes",
    "MultivariateModeIndicator",
    "PoleGroup",
    "Residuals",
    "StabilisationChart",
    "SubspaceFit",
    "Synthesis",
    "TipCalibration",
    "calibrate_to_tip",
    "candidate_groups",
    "compare_modes",
    "complex_mode_indicator",
    "derived_covariance",
    "fit_picked_poles",
    "fit_polyreference",
    "fit_subspace",
    "frequency_and_damping_errors",
    "import_modes_uff",
    "modal_assurance",
    "mode_complexity",
    "mode_reciprocity",
    "mode_shapes",
    "multivariate_mode_indicator",
    "phase_collinearity",
    "phase_deviation",
    "read_modal_model",
    "read_modes_uff",
    "read_picked_poles",
    "read_pole_groups",
    "reciprocity_residual",
    "synthesis",
    "write_modal_model",
    "write_modes_uff",
    "write_pole_candidates",
]
