"""Parts of a robot in space, each from its row: frames, joints, links, bodies."""

from math import inf, radians

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

from ..finite_elements import Material, Section, hollow_circle
from ..kinematics import LARGEST_TRAVEL, Frame
from ..serial_chains import inertia_fault, symmetric
from ..spatial import ElasticJoint, Link, LumpedBody
from .drive_table import drive_of
from .spatial_tables import BodyRow, FrameRow, JointRow, LinkRow, TubeTable


def frame_of(row: FrameRow) -> Frame:
    """A frame with angles in rad."""
    lower, upper = _limits(row)
    return Frame(
        row.name,
        row.antecedent,
        row.motion,
        row.active,
        radians(row.gamma_deg),
        row.b_m,
        radians(row.alpha_deg),
        row.d_m,
        radians(row.theta_deg),
        row.r_m,
        lower,
        upper,
    )


def _limits(row: FrameRow) -> tuple[float, float]:
    """Limits in rad or m, by the frame's motion."""
    if row.motion == "prismatic":
        given, wrong, right = row.limits_m, row.limits_deg, "limits_m"
    else:
        given, wrong, right = row.limits_deg, row.limits_m, "limits_deg"
    if wrong is not None or (given is not None and row.motion == "fixed"):
        remedy = "leave its limits out" if row.motion == "fixed" else f"give {right}"
        raise InputError(f"frame {row.name}: limits {list(wrong or given or ())} of a {row.motion} frame; {remedy}")
    if given is None:
        return (-inf, inf)
    if row.motion == "revolute":
        return radians(given[0]), radians(given[1])
    if max(map(abs, given)) > LARGEST_TRAVEL:
        raise InputError(f"frame {row.name}: limits_m = {list(given)}: give metres, at most {LARGEST_TRAVEL:g}")
    return given


def joint_of(row: JointRow, frames: tuple[Frame, ...]) -> ElasticJoint:
    """A joint; its damping has the unit of its motion."""
    frame = next((frame for frame in frames if frame.name == row.frame), None)
    slides = frame is not None and frame.motion == "prismatic"
    wrong = row.damping_nms_per_rad if slides else row.damping_ns_per_m
    if wrong:
        given, wanted = ("damping_nms_per_rad", "damping_ns_per_m")[:: 1 if slides else -1]
        raise InputError(f"joint {row.frame}: {given} = {wrong:g} has not the unit of its motion; give {wanted}")
    damping = row.damping_ns_per_m if slides else row.damping_nms_per_rad
    return ElasticJoint(row.frame, row.nodes, _stiffness(row), drive_of(row, frame), damping)


def _stiffness(row: JointRow) -> NDArray[np.float64]:
    """A stiffness that is not given is infinite: the joint is rigid in that direction."""
    radial, axial, tilting, turning = (
        inf if value is None else value
        for value in (row.radial_n_per_m, row.axial_n_per_m, row.tilting_nm_per_rad, row.turning_nm_per_rad)
    )
    return np.array([radial, radial, axial, tilting, tilting, turning])


def link_of(row: LinkRow) -> Link:
    """A link; one without a tube is rigid."""
    if row.frame is None and any(row.angles_deg):
        raise InputError(f"link {list(row.nodes)}: angles_deg turn a frame; give its name too, frame = ...")
    if row.tube is None and row.elements > 1:
        raise InputError(
            f"link {list(row.nodes)}: elements = {row.elements} of a rigid link; give it a tube, or leave it"
        )
    section = None if row.tube is None else _section(row.tube)
    delta, eta, kappa = (radians(angle) for angle in row.angles_deg)
    return Link(row.nodes, section, row.elements, row.frame, (delta, eta, kappa))


def _section(tube: TubeTable) -> Section:
    if tube.theory not in ("timoshenko", "euler-bernoulli"):
        raise InputError(f"beam theory {tube.theory!r} is none of timoshenko, euler-bernoulli")
    material = Material(tube.young_pa, tube.shear_pa, tube.density_kg_per_m3)
    return hollow_circle(tube.outer_m, tube.inner_m, material, timoshenko=tube.theory == "timoshenko")


def body_of(row: BodyRow) -> LumpedBody:
    """A body whose inertia a rigid body can have."""
    inertia = symmetric(row.inertia_kg_m2)
    fault = inertia_fault(inertia)
    if fault is not None:
        raise InputError(f"body at node {row.node}: inertia_kg_m2 = {list(row.inertia_kg_m2)}: {fault}")
    return LumpedBody(row.node, row.frame, row.mass_kg, np.array(row.centre_m), inertia)
