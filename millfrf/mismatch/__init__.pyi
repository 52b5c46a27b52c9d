from .behaviour.behaviour_of_modes import Behaviour, ModeTrend
from .behaviour.behaviour_of_recordings import behaviour_of
from .cut.comparison import COEFFICIENTS
from .cut.diagnose_cut import CutDiagnosis, diagnose_cut, write_improved_cut
from .cut.hypothesis import COEFFICIENT_NAMES
from .cut.identification.cut_forces import CutForces
from .cut.identification.dynamometer import read_dynamometer
from .cut.identification.identify import COEFFICIENT_SYMBOLS, CutCoefficients, identify_coefficients
from .cut.identification.recorded_cuts import read_cut_forces
from .cut.physics import CutPhysics
from .cut.recordings import read_cut_recording, require_room_for_cut
from .inference.diagnosis import NAMELESS, AcceptedCause, Candidate, Diagnosis
from .inference.diagnosis_file import read_diagnosis, write_diagnosis
from .inference.search import in_processes
from .inference.settings import LabError, SearchSettings, Settings
from .joints.joint_axis import joint_in_words, tip_axes
from .joints.joint_law import JointLaw
from .location.free_form_law import BinnedForce, FreeFormLaw, free_form_laws, missing_force_law
from .location.location import significant_cells
from .location.maps import BlockResidual, ResidualMap, SpindleSpeed, band_edges, spindle_speed
from .location.residual_view import HeldOutSpectra, ResidualView, StructureDiagnosis, held_out_spectra, recording_errors
from .models.first_motion import predict_lines
from .models.fitting import fit
from .models.hypothesis import Hypothesis
from .models.model_shape import ModelShape
from .models.model_terms import improved_model
from .physics.library import form_of, library, rig_of
from .physics.protocol import JointPhysics, Parameter
from .records.reading import measured_part, read_recording, read_recordings, require_room_for_comparison
from .robot.diagnosis import diagnose_robot
from .robot.posed import ROBOT
from .robot.receptance import PosedRecording, posed_channels, predicted_spectrum, read_posed
from .robot.results import CompanionNumber, RobotDiagnosis, companions_of, number_of, standard_error_of
from .screening.joint_places import estimated_motion, find_direction
from .screening.score_tests import screen_joints
from .screening.whitened_residual import linear_floor
from .structure.diagnosing import diagnose
from .structure.prediction import Prediction, equivalent_receptance, improved_model_of, predict, with_refused_model
from .structure.structures_in_time import structures_in_time

__all__ = [
    "COEFFICIENTS",
    "COEFFICIENT_NAMES",
    "COEFFICIENT_SYMBOLS",
    "NAMELESS",
    "ROBOT",
    "AcceptedCause",
    "Behaviour",
    "BinnedForce",
    "BlockResidual",
    "Candidate",
    "CompanionNumber",
    "CutCoefficients",
    "CutDiagnosis",
    "CutForces",
    "CutPhysics",
    "Diagnosis",
    "FreeFormLaw",
    "HeldOutSpectra",
    "Hypothesis",
    "JointLaw",
    "JointPhysics",
    "LabError",
    "ModeTrend",
    "ModelShape",
    "Parameter",
    "PosedRecording",
    "Prediction",
    "ResidualMap",
    "ResidualView",
    "RobotDiagnosis",
    "SearchSettings",
    "Settings",
    "SpindleSpeed",
    "StructureDiagnosis",
    "band_edges",
    "behaviour_of",
    "companions_of",
    "diagnose",
    "diagnose_cut",
    "diagnose_robot",
    "equivalent_receptance",
    "estimated_motion",
    "find_direction",
    "fit",
    "form_of",
    "free_form_laws",
    "held_out_spectra",
    "identify_coefficients",
    "improved_model",
    "improved_model_of",
    "in_processes",
    "joint_in_words",
    "library",
    "linear_floor",
    "measured_part",
    "missing_force_law",
    "number_of",
    "posed_channels",
    "predict",
    "predict_lines",
    "predicted_spectrum",
    "read_cut_forces",
    "read_cut_recording",
    "read_diagnosis",
    "read_dynamometer",
    "read_posed",
    "read_recording",
    "read_recordings",
    "recording_errors",
    "require_room_for_comparison",
    "require_room_for_cut",
    "rig_of",
    "screen_joints",
    "significant_cells",
    "spindle_speed",
    "standard_error_of",
    "structures_in_time",
    "tip_axes",
    "with_refused_model",
    "write_diagnosis",
    "write_improved_cut",
]
