from .diagnosis import diagnose_robot
from .fit import RobotFit, fit_robot
from .posed_recording import PosedRecording, posed, posed_channels, read_posed
from .posed_robot import PosedRobot
from .receptance import predicted_spectrum
from .results import CompanionNumber, RobotDetails, RobotDiagnosis, companions_of, number_of, standard_error_of
from .settings import ROBOT

__all__ = [
    "ROBOT",
    "CompanionNumber",
    "PosedRecording",
    "PosedRobot",
    "RobotDetails",
    "RobotDiagnosis",
    "RobotFit",
    "companions_of",
    "diagnose_robot",
    "fit_robot",
    "number_of",
    "posed",
    "posed_channels",
    "predicted_spectrum",
    "read_posed",
    "standard_error_of",
]
