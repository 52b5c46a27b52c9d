"""What is wrong with a robot's model: recordings in several postures against a few numbers of the robot."""

from .posed_recording import PosedRecording, posed, posed_channels, read_posed
from .robot_diagnosis import EXPLAINED, NOISE_LIKE, ROBOT_ERROR, diagnose_robot
from .robot_diagnosis_file import robot_diagnosis_content, write_robot_diagnosis
from .robot_fit import RobotFit, fit_robot
from .robot_held_out import SIGNIFICANT
from .robot_results import Beside, HeldOut, RobotCause, RobotDiagnosis
from .robot_setting import Setting

__all__ = [
    "EXPLAINED",
    "NOISE_LIKE",
    "ROBOT_ERROR",
    "SIGNIFICANT",
    "Beside",
    "HeldOut",
    "PosedRecording",
    "RobotCause",
    "RobotDiagnosis",
    "RobotFit",
    "Setting",
    "diagnose_robot",
    "fit_robot",
    "posed",
    "posed_channels",
    "read_posed",
    "robot_diagnosis_content",
    "write_robot_diagnosis",
]
