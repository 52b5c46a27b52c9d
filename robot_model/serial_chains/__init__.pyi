from .chain_file import Told, chain_text
from .chain_robot import spatial_robot
from .dh_chain import CONVENTIONS, read_dh
from .first_posture import ready_posture
from .frames_of_axes import axis_frames, fixed_frames, turn_onto
from .rigid_places import inertia_fault, place_of, shift_and_angles, six_of, symmetric
from .serial_chain import BASE, RigidPart, SerialChain, SerialJoint
from .stiffness_ranges import CLASSES, StiffnessClass, class_of, typical
from .urdf_chain import ReadChain, read_urdf

__all__ = [
    "BASE",
    "CLASSES",
    "CONVENTIONS",
    "ReadChain",
    "RigidPart",
    "SerialChain",
    "SerialJoint",
    "StiffnessClass",
    "Told",
    "axis_frames",
    "chain_text",
    "class_of",
    "fixed_frames",
    "inertia_fault",
    "place_of",
    "read_dh",
    "read_urdf",
    "ready_posture",
    "shift_and_angles",
    "six_of",
    "spatial_robot",
    "symmetric",
    "turn_onto",
    "typical",
]
