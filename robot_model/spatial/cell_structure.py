"""A robot in a posture as the structure of the simulated cell: tool tip and spindle housing, modes alone."""

import numpy as np
from numpy.typing import NDArray

from foundation import HOUSING, TIP, InputError
from modal_fit import ModalModel

from .compliant_tool import housing_node
from .spatial_modes import damping_of_modes, modes_at
from .spatial_robot import SpatialRobot

Real = NDArray[np.float64]


def cell_structure_at(
    robot: SpatialRobot, q: Real, sensor: Real, *, axes: Real | None = None, highest_frequency: float = 2000.0
) -> ModalModel:
    """Give the modal model with motion at the tip and at a sensor on the spindle, and forces at the tip.

    The sensor sits on the spindle: it moves by ``t + theta x r`` with the translation and rotation, in every mode, of
    the tip, or of the node before the tool's spring where the robot has one (Mohammadi & Ahmadi, Fig. 12 a). Modes are
    real, so that ``sum 2 Re(right left^T) = 0``: a step of force gives no step of velocity. Higher and overdamped modes
    are dropped, without a residual: the cell integrates modes. Of the joints' own damping each mode gets its share;
    what couples modes is left out.

    Parameters
    ----------
    robot
        Robot whose structure is computed.
    q : (n_moving,), rad or m
        Joint values of the posture.
    sensor : (3,), m
        Place of the sensor from the tip, in the axes of the model.
    axes : (3, 3) or None
        Axes X, Y, Z of the model as columns, in the base frame.
    highest_frequency : Hz
        Highest undamped natural frequency that is kept.

    Raises
    ------
    InputError
        No damped mode is left.
    """
    modes = modes_at(robot, q)
    turn = np.eye(3) if axes is None else np.asarray(axes, dtype=float)
    tip = modes.shapes[:, modes.structure.tip]
    housing = modes.shapes[:, housing_node(robot)]
    moved, held, turned = tip[:, :3] @ turn, housing[:, :3] @ turn, housing[:, 3:] @ turn
    natural, twice = np.sqrt(modes.squares), np.diag(damping_of_modes(robot, modes))
    kept = (natural < 2 * np.pi * highest_frequency) & (twice < 2 * natural) & (twice > 0)
    if not kept.any():
        raise InputError("no damped mode is left for the simulated cell; give the robot damping, or more modes")
    damped = np.sqrt(modes.squares[kept] - twice[kept] ** 2 / 4)
    right = np.hstack([moved, held + np.cross(turned, np.asarray(sensor, dtype=float))])[kept].astype(complex)
    left = moved[kept] / (2j * damped[:, None])
    return ModalModel(-twice[kept] / 2 + 1j * damped, right, left, (*TIP, *HOUSING), TIP)
