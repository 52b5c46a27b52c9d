"""`millfrf robot show`: a robot in a posture on one page, to turn in a browser, with its numbers."""

import webbrowser
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from millfrf.core import InputError, writing_whole_file
from millfrf.robot_model import (
    PostureResult,
    SpatialCase,
    StructureModes,
    close_loops,
    in_posture,
    modes_at,
    read_robot,
    shown_values,
    structure_at,
)

from ...options import check_output
from ..postures import Asked, posture_of, spatial
from .page_of_modes import Fact, mode_page

Real = NDArray[np.float64]


def show_robot(robot: str, asked: Asked, out: Path, browser: bool = False) -> list[str]:
    """Write the page; lines that say what is on it.

    Raises
    ------
    InputError
        A planar robot, or a posture that is not there.
    """
    check_output(out, (".html",))
    case = spatial(read_robot(robot))
    driven, axes = posture_of(case, asked)
    q = close_loops(case.robot.mechanism, driven)
    result = in_posture(case, driven, axes)
    structure = structure_at(case.robot, q)
    empty = StructureModes(structure, np.zeros(0), np.zeros((0, len(structure.positions), 6)))
    modes = modes_at(case.robot, q) if len(result.frequencies) else empty
    facts = (_joint_facts(case, q), _posture_facts(case, driven, q, result))
    with writing_whole_file(out) as unfinished:
        unfinished.write_text(mode_page(case.name, modes, facts, result.warnings), encoding="utf-8")
    if browser and not webbrowser.open(out.resolve().as_uri()):
        raise InputError(f"no browser was found; open {out} in one")
    return [*(f"warning: {warning}" for warning in result.warnings), f"wrote {out}: open it in a browser"]


def _joint_facts(case: SpatialCase, q: Real) -> Fact:
    """One row a moving joint: value, limits, stiffness along its own motion."""
    mechanism, rows = case.robot.mechanism, []
    for index, value in zip(mechanism.moving, q, strict=True):
        frame = mechanism.frames[index]
        sliding = frame.motion == "prismatic"
        scale, unit = (1.0, "m") if sliding else (180 / np.pi, "deg")
        limits = "none"
        if np.isfinite([frame.lower, frame.upper]).all():
            limits = f"{scale * frame.lower:.4g} to {scale * frame.upper:.4g} {unit}"
        own = [joint.stiffness[2 if sliding else 5] for joint in case.robot.joints if joint.frame == frame.name]
        stiffness = "rigid"
        if own and np.isfinite(sum(own)):
            stiffness = f"{sum(own):.3g} {'N/m' if sliding else 'N m/rad'}"
        rows.append((frame.name, frame.motion, f"{scale * value:.4g} {unit}", limits, stiffness))
    return Fact("Joints", ("joint", "motion", "value", "limits", "stiffness along its motion"), tuple(rows))


def _posture_facts(case: SpatialCase, driven: Real, q: Real, result: PostureResult) -> Fact:
    """Place of the tip, moving mass, softest direction."""
    structure = structure_at(case.robot, q)
    place = ", ".join(f"{value:.4f}" for value in structure.positions[case.robot.tip])
    values, directions = np.linalg.eigh(result.compliance[:3, :3])
    along = ", ".join(f"{value:+.2f}" for value in directions[:, -1])
    links = sum(
        beam.section.mass * float(np.linalg.norm(np.diff(structure.positions[list(beam.nodes)], axis=0)))
        for beam in structure.beams
    )
    mass = sum(body.mass for body in case.robot.bodies) + links
    rows = [
        ("posture", shown_values(case.robot.mechanism, driven)),
        ("tool tip", f"{place} m"),
        ("mass of bodies and links", f"{mass:.4g} kg" if mass else "not known"),
        ("softest direction of the tip", f"{1e-6 / values[-1]:.3g} N/µm along ({along})"),
    ]
    return Fact("Posture", ("what", "value"), tuple(rows))
