from .amplitude import AmplitudeDependence, amplitude_dependence
from .indicators import (
    ComplexModeIndicator,
    MultivariateModeIndicator,
    complex_mode_indicator,
    multivariate_mode_indicator,
)
from .models.modal_model import BandSource, ModalModel, ModeErrors
from .models.model_file import read_modal_model, write_modal_model
from .models.out_of_band import Residuals
from .models.synthesis import (
    ModePair,
    Synthesis,
    compare_modes,
    derived_covariance,
    outside_as_residuals,
    pack_parameters,
    synthesis,
    unpack_parameters,
)
from .pole_picking import (
    CandidateGroup,
    PolesFile,
    candidate_groups,
    read_picked_poles,
    read_pole_groups,
    write_pole_candidates,
)
from .polyreference import ModalFit, fit_picked_poles, fit_polyreference
from .shapes import ModeShapes, mode_reciprocity, mode_shapes
from .stabilisation import StabilisationChart, chart_from_json, chart_to_json
from .subspace import SubspaceFit, fit_subspace
from .substructures.base import Base, identify_base
from .substructures.beam import bending_stiffness, shear_factor
from .substructures.prediction import PredictedTip, first_clamped_frequency, predict_tip
from .substructures.taps import taps_of_blanks
from .substructures.tool_file import Tool, ToolTable, read_tool
from .time_variation import moving_modes
from .tip.calibration import TipCalibration, calibrate_to_tip
from .uff_models import import_modes_uff, write_modes_uff

__all__ = [
    "AmplitudeDependence",
    "BandSource",
    "Base",
    "CandidateGroup",
    "ComplexModeIndicator",
    "ModalFit",
    "ModalModel",
    "ModeErrors",
    "ModePair",
    "ModeShapes",
    "MultivariateModeIndicator",
    "PolesFile",
    "PredictedTip",
    "Residuals",
    "StabilisationChart",
    "SubspaceFit",
    "Synthesis",
    "TipCalibration",
    "Tool",
    "ToolTable",
    "amplitude_dependence",
    "bending_stiffness",
    "calibrate_to_tip",
    "candidate_groups",
    "chart_from_json",
    "chart_to_json",
    "compare_modes",
    "complex_mode_indicator",
    "derived_covariance",
    "first_clamped_frequency",
    "fit_picked_poles",
    "fit_polyreference",
    "fit_subspace",
    "identify_base",
    "import_modes_uff",
    "mode_reciprocity",
    "mode_shapes",
    "moving_modes",
    "multivariate_mode_indicator",
    "outside_as_residuals",
    "pack_parameters",
    "predict_tip",
    "read_modal_model",
    "read_picked_poles",
    "read_pole_groups",
    "read_tool",
    "shear_factor",
    "synthesis",
    "taps_of_blanks",
    "unpack_parameters",
    "write_modal_model",
    "write_modes_uff",
    "write_pole_candidates",
]
