from .causes import Cause, PostureFrequencies, equivalent_causes, explain_frequencies
from .change import Change, Companion, Numbered
from .variations import (
    end_bodies,
    with_damping_factor,
    with_joint_factor,
    with_lighter_end,
    with_link_factor,
    with_payload,
    with_rigid_links,
)
from .weighed_changes import changed_robot, possible_changes, unnamed_changes

__all__ = [
    "Cause",
    "Change",
    "Companion",
    "Numbered",
    "PostureFrequencies",
    "changed_robot",
    "end_bodies",
    "equivalent_causes",
    "explain_frequencies",
    "possible_changes",
    "unnamed_changes",
    "with_damping_factor",
    "with_joint_factor",
    "with_lighter_end",
    "with_link_factor",
    "with_payload",
    "with_rigid_links",
]
