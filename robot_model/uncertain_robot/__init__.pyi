from .bands import apart_from_higher, below_new_modes, derived_errors, frf_with_errors, with_model_covariance
from .document import updated_document
from .draws import drawn_robots, principal_shifts, shifted_robot
from .uncertainty import RobotUncertainty

__all__ = [
    "RobotUncertainty",
    "apart_from_higher",
    "below_new_modes",
    "derived_errors",
    "drawn_robots",
    "frf_with_errors",
    "principal_shifts",
    "shifted_robot",
    "updated_document",
    "with_model_covariance",
]
