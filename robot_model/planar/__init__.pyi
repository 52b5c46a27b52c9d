from .flexible_links import FlexibleChain, flexible_chain
from .natural_coordinates import NaturalChain
from .planar_robot import TIP_IN_PLANE, PlanarRobot
from .rigid_links import planar_compliance, planar_sag, rigid_matrices, rigid_model, tip_jacobian

__all__ = [
    "TIP_IN_PLANE",
    "FlexibleChain",
    "NaturalChain",
    "PlanarRobot",
    "flexible_chain",
    "planar_compliance",
    "planar_sag",
    "rigid_matrices",
    "rigid_model",
    "tip_jacobian",
]
