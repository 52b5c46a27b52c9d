"""Where a model and recordings disagree: locate it, name the physics, model it, show the fit improve."""

from estimation import WindowedSpectrum, windowed_spectrum

from .adapters.structure import Prediction, diagnose, improved_model_of, predict
from .inference import (
    AcceptedCause,
    Candidate,
    Diagnosis,
    Improvement,
    LabError,
    Settings,
    read_diagnosis,
    write_diagnosis,
)
from .joints.joint_law import JointLaw, JointMotion
from .location.structure_details import StructureDetails, StructureDiagnosis
from .models.fitting import Fit, fit, residual
from .models.hypothesis import Cause, Hypothesis, predict_lines
from .models.model_shape import ModelShape
from .records.reading import band_of, read_recording, read_recordings
from .screening.joint_direction import JointSighting, SeenMotion, find_direction, seen_motion
from .screening.linear_floor import Floor, linear_floor

__all__ = [
    "AcceptedCause",
    "Candidate",
    "Cause",
    "Diagnosis",
    "Fit",
    "Floor",
    "Hypothesis",
    "Improvement",
    "JointLaw",
    "JointMotion",
    "JointSighting",
    "LabError",
    "ModelShape",
    "Prediction",
    "SeenMotion",
    "Settings",
    "StructureDetails",
    "StructureDiagnosis",
    "WindowedSpectrum",
    "band_of",
    "diagnose",
    "find_direction",
    "fit",
    "improved_model_of",
    "linear_floor",
    "predict",
    "predict_lines",
    "read_diagnosis",
    "read_recording",
    "read_recordings",
    "residual",
    "seen_motion",
    "windowed_spectrum",
    "write_diagnosis",
]
