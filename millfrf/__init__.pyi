from acquisition import Channel, Recording, Stream
from estimation import CrossSpectra, Frf
from millfrf.core import (
    DegreeOfFreedom,
    FileFormatError,
    InputError,
    MillfrfError,
    MillfrfWarning,
    accepting_edited,
)
from millfrf.cutting import MillingProcess, milling_process
from millfrf.mismatch import Diagnosis, Settings
from millfrf.stability import StabilityLobes
from modal_fit import ModalFit, ModalModel, SubspaceFit, TipCalibration

from .steps.calibrate import calibrate
from .steps.chatter import chatter
from .steps.convert import convert
from .steps.cut_diagnose import cut_diagnose
from .steps.cut_identify import cut_identify
from .steps.cut_simulate import cut_simulate
from .steps.cut_wall import cut_wall
from .steps.diagnose import diagnose
from .steps.estimate import Estimate, estimate
from .steps.fit import fit
from .steps.inspect import inspect, open
from .steps.learn import LearnResult, learn
from .steps.lobes import lobes
from .steps.plan import plan
from .steps.predict import Predicted, predict
from .steps.recording.acquire import acquire
from .steps.recording.recover import recover
from .steps.recording.watch import watch
from .steps.report import report
from .steps.tap import TapResult, tap
from .steps.tool import ToolTip, tool
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
    "LearnResult",
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
    "ToolTip",
    "__version__",
    "accepting_edited",
    "acquire",
    "calibrate",
    "chatter",
    "convert",
    "cut_diagnose",
    "cut_identify",
    "cut_simulate",
    "cut_wall",
    "diagnose",
    "estimate",
    "fit",
    "inspect",
    "learn",
    "lobes",
    "milling_process",
    "open",
    "plan",
    "predict",
    "recover",
    "report",
    "tap",
    "tool",
    "watch",
]
