"""Where a model and recordings disagree: locate it, name the physics, model it, show the fit improve."""

from .diagnose import Settings, diagnose
from .diagnosis import AcceptedCause, Candidate, Diagnosis, Improvement
from .explanation import Cause, Explanation, predict_lines
from .fitting import Fit, fit, residual
from .joint_direction import JointSighting, SeenMotion, find_direction, seen_motion
from .joint_law import JointLaw, JointMotion
from .linear_floor import Floor, linear_floor
from .shape_of_model import LabError, ModelShape
from .trial import Trial, band_of, read_trial, read_trials
from .windowed_lines import WindowedLines, windowed_lines

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
    "Trial",
    "WindowedLines",
    "band_of",
    "diagnose",
    "find_direction",
    "fit",
    "linear_floor",
    "predict_lines",
    "read_trial",
    "read_trials",
    "residual",
    "seen_motion",
    "windowed_lines",
]
