from .comparing import Diagnosis, Settings, diagnose
from .estimating import (
    Channel,
    CrossSpectra,
    DegreeOfFreedom,
    Estimate,
    Frf,
    TapResult,
    estimate,
    tap,
)
from .fitting import ModalFit, ModalModel, SubspaceFit, TipCalibration, calibrate, fit
from .limits import MillingProcess, StabilityLobes, lobes
from .opening import FileFormatError, InputError, MillfrfError, MillfrfWarning, Recording, Stream, open
from .predicting import Predicted, predict

__all__ = [
    "Channel",
    "CrossSpectra",
    "DegreeOfFreedom",
    "Diagnosis",
    "Estimate",
    "FileFormatError",
    "Frf",
    "InputError",
    "MillfrfError",
    "MillfrfWarning",
    "MillingProcess",
    "ModalFit",
    "ModalModel",
    "Predicted",
    "Recording",
    "Settings",
    "StabilityLobes",
    "Stream",
    "SubspaceFit",
    "TapResult",
    "TipCalibration",
    "calibrate",
    "diagnose",
    "estimate",
    "fit",
    "lobes",
    "open",
    "predict",
    "tap",
]
