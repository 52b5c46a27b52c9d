"""Modal models as a laboratory would measure them on the nonlinear cell, and the robot as the package models it."""

from dataclasses import dataclass, replace

import numpy as np
from independent_robot import Lump
from nonlinear_cell import NonlinearCell, drawn_cell, drawn_postures
from numpy.typing import NDArray

from millfrf.core import TIP
from millfrf.robot_model import SpatialRobot, measured_modes, read_spatial_robot
from millfrf.robot_model.posture_process.modal_basis import MeasuredModes
from millfrf.robot_model.spatial.spatial_robot import LumpedBody
from modal_fit import ModalModel, ModeErrors

Real = NDArray[np.float64]

NODES = (2, 4, 6, 8, 9, 10)
"""Of the package's robot, behind each axis."""

NOISE = (0.002, 0.04, 0.03)
"""Relative standard errors of a measured frequency, damping ratio and shape."""

MODES = 6
"""Modes that are measured: the lowest ones."""


@dataclass(frozen=True)
class MeasuredCell:
    """A cell, its model, and what was measured in some postures."""

    cell: NonlinearCell
    robot: SpatialRobot
    models: tuple[ModalModel, ...]
    postures: Real

    @property
    def measured(self) -> tuple[MeasuredModes, ...]:
        """Its measurements as the process takes them."""
        pairs = zip(self.postures, self.models, strict=True)
        return tuple(measured_modes(f"posture {i}", q, model) for i, (q, model) in enumerate(pairs, 1))


def believed(lumps: tuple[Lump, ...], springs: tuple[float, ...]) -> SpatialRobot:
    """The robot as the package models it: rigid links, a rigid tool, springs about the axes."""
    kuka = read_spatial_robot("kuka_kr90_r3100").robot
    bodies = tuple(
        LumpedBody(NODES[each.axis], str(each.axis + 1), each.mass, np.array(each.centre), np.diag(each.inertia))
        for each in lumps
    )
    joints = tuple(
        replace(joint, stiffness=np.array([np.inf] * 5 + [k])) for joint, k in zip(kuka.joints, springs, strict=True)
    )
    return replace(kuka, joints=joints, bodies=bodies, links=tuple(replace(each, section=None) for each in kuka.links))


def true_model(cell: NonlinearCell, q: Real) -> ModalModel:
    """The cell's modal model about a posture, all modes."""
    return _model(*cell.modes(q))


def measured_model(cell: NonlinearCell, q: Real, rng: np.random.Generator) -> ModalModel:
    """The lowest modes with noise, whose size the model states."""
    natural, ratios, tip = (part[:MODES] for part in cell.modes(q))
    natural = natural * np.exp(NOISE[0] * rng.normal(size=MODES))
    ratios = ratios * np.exp(NOISE[1] * rng.normal(size=MODES))
    tip = tip + NOISE[2] * np.linalg.norm(tip, axis=1)[:, None] * rng.normal(size=tip.shape)
    errors = np.column_stack([NOISE[0] * natural / (2 * np.pi), NOISE[1] * ratios])
    nothing = np.full_like(errors, np.nan)
    return replace(_model(natural, ratios, tip), errors=ModeErrors(errors, nothing, nothing, np.zeros_like(errors)))


def measured_cell(seed: int, count: int = 12) -> MeasuredCell:
    """A cell drawn with a seed and measured in some postures."""
    rng = np.random.default_rng(seed)
    cell, lumps, springs = drawn_cell(rng)
    postures = drawn_postures(rng, count)
    models = tuple(measured_model(cell, q, rng) for q in postures)
    return MeasuredCell(cell, believed(lumps, springs), models, postures)


def _model(natural: Real, ratios: Real, tip: Real) -> ModalModel:
    damped = natural * np.sqrt(1 - ratios**2)
    right = tip.astype(complex)
    return ModalModel(-ratios * natural + 1j * damped, right, right / (2j * damped[:, None]), TIP, TIP)
