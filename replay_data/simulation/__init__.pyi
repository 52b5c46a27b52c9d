from .joint_march import LINEAR, JointLaw, tip_motion
from .material import Material, material_named
from .milling_loop import empty_memory, mill, prepare_cut
from .modal_integrator import ResponseMap, discretise, require_simulable, respond
from .settling import Settling, settle

__all__ = [
    "LINEAR",
    "JointLaw",
    "Material",
    "ResponseMap",
    "Settling",
    "discretise",
    "empty_memory",
    "material_named",
    "mill",
    "prepare_cut",
    "require_simulable",
    "respond",
    "settle",
    "tip_motion",
]
