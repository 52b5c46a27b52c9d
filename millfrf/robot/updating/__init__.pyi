from .asking import Asking
from .measured_files import read_measured
from .updating_files import update_robot_file

__all__ = ["Asking", "read_measured", "update_robot_file"]
