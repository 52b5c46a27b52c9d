from .errors_by_recording import recording_errors
from .free_form_law import BinnedForce, FreeFormLaw, free_form_laws
from .locate import located, significant_cells
from .residual_maps import ResidualMap, band_edges
from .spectra_held_out import HeldOutSpectra, held_out_spectra
from .spindle_orders import SPEED, SpindleSpeed, spindle_speed
from .structure_details import StructureDetails, StructureDiagnosis
from .time_maps import BlockResidual
from .view_of_residual import ResidualView, residual_view

__all__ = [
    "SPEED",
    "BinnedForce",
    "BlockResidual",
    "FreeFormLaw",
    "HeldOutSpectra",
    "ResidualMap",
    "ResidualView",
    "SpindleSpeed",
    "StructureDetails",
    "StructureDiagnosis",
    "band_edges",
    "free_form_laws",
    "held_out_spectra",
    "located",
    "recording_errors",
    "residual_view",
    "significant_cells",
    "spindle_speed",
]
