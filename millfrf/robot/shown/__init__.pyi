from .compliance_picture import compliance_figure, joint_shares
from .number_tables import write_compliance_table, write_receptance_table
from .receptance_picture import receptance_figure
from .robot_page import show_robot

__all__ = [
    "compliance_figure",
    "joint_shares",
    "receptance_figure",
    "show_robot",
    "write_compliance_table",
    "write_receptance_table",
]
