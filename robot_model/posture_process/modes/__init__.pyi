from .correction import CorrectedModes, corrected_modes, modelled_damping, shape_slopes
from .modal_basis import ModalBasis, PosturePlace, arc_weights, basis_at, part_names
from .pairing import AT_FIRST, KNOWN, mode_pairs
from .posture_measurement import MeasuredModes, measured_modes

__all__ = [
    "AT_FIRST",
    "KNOWN",
    "CorrectedModes",
    "MeasuredModes",
    "ModalBasis",
    "PosturePlace",
    "arc_weights",
    "basis_at",
    "corrected_modes",
    "measured_modes",
    "mode_pairs",
    "modelled_damping",
    "part_names",
    "shape_slopes",
]
