from .compliance_picture import compliance_figure, joint_shares
from .drawn_robot import robot_figure
from .number_tables import write_compliance_table, write_receptance_table
from .page_of_modes import mode_page
from .receptance_picture import receptance_figure
from .robot_page import show_robot

__all__ = [
    "compliance_figure",
    "joint_shares",
    "mode_page",
    "receptance_figure",
    "robot_figure",
    "show_robot",
    "write_compliance_table",
    "write_receptance_table",
]
