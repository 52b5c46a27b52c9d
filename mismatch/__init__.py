"""Where a model and recordings disagree: locate it, name the physics, model it, show the fit improve."""

from .adapters.structure.diagnose import Settings, diagnose
from .inference.diagnosis import AcceptedCause, Candidate, Diagnosis, Improvement
from .joints.joint_law import JointLaw, JointMotion
from .models.fitting import Fit, fit, residual
from .models.hypothesis import Cause, Explanation, predict_lines
from .models.model_shape import LabError, ModelShape
from .records.reading import band_of, read_recording, read_recordings
from .screening.joint_direction import JointSighting, SeenMotion, find_direction, seen_motion
from .screening.linear_floor import Floor, linear_floor

__all__ = [
    "AcceptedCause",
    "Candidate",
    "Cause",
    "Diagnosis",
    "Explanation",
    "Fit",
    "Floor",
    "Improvement",
    "JointLaw",
    "JointMotion",
    "JointSighting",
    "LabError",
    "ModelShape",
    "SeenMotion",
    "Settings",
    "band_of",
    "diagnose",
    "find_direction",
    "fit",
    "linear_floor",
    "predict_lines",
    "read_recording",
    "read_recordings",
    "residual",
    "seen_motion",
]
