from acquisition import Channel, Recording, Stream
from estimation import CrossSpectra, Frf
from millfrf.core import DegreeOfFreedom, FileFormatError, InputError, MillfrfError, MillfrfWarning
from millfrf.cutting import MillingProcess
from millfrf.mismatch import Diagnosis, Settings
from millfrf.stability import StabilityLobes
from modal_fit import ModalFit, ModalModel, SubspaceFit, TipCalibration

from .steps.face_diagnose import diagnose
from .steps.face_estimate import estimate, tap
from .steps.face_fit import calibrate, fit
from .steps.face_lobes import lobes
from .steps.face_predict import predict
from .steps.opening import open
from .steps.predict import Predicted
from .steps.tap import TapResult
from .steps.test_spectra import Estimate
from .version import __version__

PACKAGES: tuple[str, ...]

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
    "__version__",
    "calibrate",
    "diagnose",
    "estimate",
    "fit",
    "lobes",
    "open",
    "predict",
    "tap",
]
