"""Changes of a robot's model weighed against frequencies measured in several postures."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import scipy

from millfrf.core import InputError, Real

from ..finite_elements.statics import with_gravity
from ..spatial.spatial_modes import modes_at, tool_spring, with_tool_spring
from ..spatial.spatial_robot import SpatialRobot
from .changes import (
    Change,
    Changed,
    Companion,
    Numbered,
    end_bodies,
    with_damping_factor,
    with_joint_factor,
    with_lighter_end,
    with_link_factor,
    with_payload,
    with_rigid_links,
)

_FACTORS = (0.05, 20.0)
_MASSES = (0.2, 5.0)
_FACTOR_STARTS = tuple(float(value) for value in np.geomspace(0.2, 5.0, 16))
_LINK_STARTS = (*(float(value) for value in np.geomspace(0.05, 5.0, 12)), 100.0)
_PAYLOADS = tuple(float(value) for value in np.geomspace(0.5, 100.0, 14))
_COMPLIANCES = tuple(float(value) for value in np.geomspace(1e-8, 2e-6, 12))
_OFFSETS = tuple(float(value) for value in np.radians([-8.0, -4.0, -2.0, -1.0, 1.0, 2.0, 4.0, 8.0]))


def possible_changes(
    robot: SpatialRobot, *, payload_at: Real | None = None, rigid_links: bool = False
) -> tuple[Change, ...]:
    """Every change that this robot's model can undergo.

    A payload hangs at ``payload_at`` (3,) from the tool tip in the tool frame, m; None: its place is not known and
    fitted with its mass. A negative one is mass that the model's spindle has and the robot's has not. A tool may give
    way where the model's is rigid. Gravity is weighed where the model has none and the chain is open; damping is one
    factor for all modes. ``rigid_links``: the model is used with its links made rigid, so that their flexibility may
    have been left out.
    """
    nothing = np.zeros(len(robot.mechanism.moving))
    changes = [
        Change(
            f"joint {joint.frame} stiffness",
            "stiffness",
            "",
            True,
            _FACTOR_STARTS,
            _FACTORS,
            1.0,
            partial(_with_joint, joint.frame, nothing),
        )
        for joint in robot.joints
        if np.isfinite(joint.stiffness).any()
    ]
    if any(link.section is not None for link in robot.links):
        name = "link flexibility left out" if rigid_links else "links"
        changes.append(Change(name, "links", "", True, _LINK_STARTS, (1e-2, 1e3), 1.0, partial(_with_links, nothing)))
    changes.append(_payload(robot, payload_at))
    if tool_spring(robot) is None:
        changes.append(_tool(nothing))
    for column, index in enumerate(robot.mechanism.moving):
        if robot.mechanism.frames[index].active and robot.mechanism.frames[index].motion == "revolute":
            name = f"posture of joint {robot.mechanism.frames[index].name}"
            offset = partial(_with_offset, np.eye(len(nothing))[column])
            changes.append(Change(name, "posture", "rad", False, _OFFSETS, (-0.5, 0.5), 0.0, offset))
    if not robot.gravity and not robot.mechanism.closures:
        gravity = Change("gravity", "gravity", "m/s^2", True, (9.81,), (1.0, 20.0), 1.0, partial(_with_weight, nothing))
        changes.append(gravity)
    if robot.damping_ratio or any(robot.rayleigh):
        damped = partial(_with_damping, nothing)
        changes.append(Change("damping", "damping", "", True, _FACTOR_STARTS, _FACTORS, 1.0, damped))
    return tuple(changes)


def unnamed_changes(robot: SpatialRobot) -> tuple[Change, ...]:
    """Factors on the masses of bodies, which no diagnosis names: what numbers that are named owe to such errors."""
    nothing = np.zeros(len(robot.mechanism.moving))
    return tuple(
        Change(
            f"mass of the body on node {body.node}",
            "mass",
            "",
            True,
            _FACTOR_STARTS,
            _MASSES,
            1.0,
            partial(_with_mass, place, nothing),
        )
        for place, body in enumerate(robot.bodies)
        if body.mass > 0
    )


def _payload(robot: SpatialRobot, payload_at: Real | None) -> Change:
    """Mass at the tool end, of both signs, with its place where that is not known."""
    nothing = np.zeros(len(robot.mechanism.moving))
    lightest = -0.9 * max((robot.bodies[i].mass for i in end_bodies(robot)), default=0.0)
    values = _PAYLOADS + tuple(share * lightest for share in (0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 0.9) if lightest)
    loaded = partial(_with_load, payload_at, nothing)
    places = () if payload_at is not None else _places(robot)
    return Change("payload", "payload", "kg", False, values, (lightest, 500.0), 0.0, loaded, 1.0, places)


def _places(robot: SpatialRobot) -> tuple[Companion, ...]:
    """Give the places where a mass may hang: between the last axis and the tip, a quarter of that beside the tool."""
    mechanism = robot.mechanism
    placed = mechanism.transforms(np.zeros(len(mechanism.moving)))
    tool, last = placed[mechanism.index(mechanism.tool)], placed[mechanism.moving[-1]]
    back = tool[:3, :3].T @ (last[:3, 3] - tool[:3, 3])
    reach = max(float(np.sqrt(back @ back)), 0.1)
    return tuple(
        Companion(f"place {axis} from the tip", "m", (middle - 1.0, middle + 1.0), middle, spread)
        for axis, middle, spread in zip("xyz", (back / 2).tolist(), (reach / 4, reach / 4, reach / 2), strict=True)
    )


def _tool(nothing: Real) -> Change:
    axial = Companion("axial", "m/N", (0.0, 1e-4), 0.0, 2e-7, 1e-8)
    given = partial(_with_tool, nothing)
    return Change("tool compliance", "tool", "m/N", True, _COMPLIANCES, (1e-10, 1e-4), 1e-9, given, 0.0, (axial,))


def changed_robot(robot: SpatialRobot, changes: Sequence[Numbered], *, rigid_links: bool = False) -> Changed:
    """The robot with all changes at their numbers, each with the numbers of its companions that follow it.

    ``rigid_links``: the links are rigid unless one of the changes gives them their flexibility back.
    """
    offset = np.zeros(len(robot.mechanism.moving))
    for position, (change, number) in enumerate(changes):
        if isinstance(change, Companion):
            continue
        own = [beside for one, beside in changes[position + 1 :] if one in change.companions]
        robot, aside = change.apply(robot, number, *own)
        offset = offset + aside
    if rigid_links and all(isinstance(change, Companion) or change.kind != "links" for change, _ in changes):
        robot = with_rigid_links(robot)
    return robot, offset


def _with_joint(frame: str, offset: Real, robot: SpatialRobot, factor: float) -> Changed:
    return with_joint_factor(robot, frame, factor), offset


def _with_links(offset: Real, robot: SpatialRobot, factor: float) -> Changed:
    return with_link_factor(robot, factor), offset


def _with_load(known: Real | None, offset: Real, robot: SpatialRobot, mass: float, *place: float) -> Changed:
    if mass == 0:
        return robot, offset
    if known is None and not place:
        place = tuple(one.neutral for one in _places(robot))
    where = np.array(place) if known is None else known
    if mass > 0:
        return with_payload(robot, mass, where), offset
    return with_lighter_end(robot, -mass, None if known is not None else where), offset


def _with_tool(offset: Real, robot: SpatialRobot, lateral: float, axial: float = 0.0) -> Changed:
    return with_tool_spring(robot, lateral, axial), offset


def _with_offset(direction: Real, robot: SpatialRobot, angle: float) -> Changed:
    return robot, angle * direction


def _with_weight(offset: Real, robot: SpatialRobot, gravity: float) -> Changed:
    return with_gravity(robot, gravity), offset


def _with_damping(offset: Real, robot: SpatialRobot, factor: float) -> Changed:
    return with_damping_factor(robot, factor), offset


def _with_mass(place: int, offset: Real, robot: SpatialRobot, factor: float) -> Changed:
    bodies = list(robot.bodies)
    bodies[place] = replace(bodies[place], mass=factor * bodies[place].mass, inertia=factor * bodies[place].inertia)
    return replace(robot, bodies=tuple(bodies)), offset


_BLIND = "posture of joint 1"
"""A turn of the whole robot changes no frequency."""

AS_GOOD = 6.0
"""Rise of chi^2 up to which another cause with as many parameters counts as equivalent (likelihood ratio of 20)."""


@dataclass(frozen=True)
class PostureFrequencies:
    """Lowest natural frequencies found in a posture: q (n_moving,), frequencies (n_modes,), Hz, rising."""

    q: Real
    frequencies: Real


@dataclass(frozen=True)
class Cause:
    """One explanation of measured frequencies, fitted to them.

    Parameters
    ----------
    name
        Name of the change, as in :class:`millfrf.robot_model.Change`, or ``as modelled`` (nothing changed).
    parameter, standard_error
        The change's number (a factor, kg, rad, m/s^2); 1 and 0 where nothing changed. Infinite: the frequencies do not
        depend on it.
    chi_square
        Sum of squared deviations in units of their expected error.
    n_data
        Number of frequencies compared; an explanation that is right leaves a chi^2 near it.
    """

    name: str
    parameter: float
    standard_error: float
    chi_square: float
    n_data: int


def explain_frequencies(
    robot: SpatialRobot, found: Sequence[PostureFrequencies], relative_error: float = 0.005
) -> tuple[Cause, ...]:
    """Fit every single cause to the frequencies; give them best first, ``as modelled`` among them.

    Each cause has one parameter, so the causes are compared by chi^2 alone; those within ``AS_GOOD`` of the best cannot
    be told apart from these postures (:func:`equivalent_causes`). One posture rarely tells joints apart; several do,
    because each loads the joints in another way. A payload hangs at the tip here; a tool's compliance and damping leave
    the frequencies as they are and are not asked.

    Parameters
    ----------
    robot
        The robot as modelled.
    found
        Lowest frequencies at one posture or more.
    relative_error
        Standard error of a frequency over its value.

    Raises
    ------
    InputError
        No frequencies, or an error that is not positive.
    """
    n_data = sum(len(case.frequencies) for case in found)
    if not n_data or not relative_error > 0:
        raise InputError(f"{n_data} frequencies with relative error {relative_error!r}: both must be positive")

    def deviations(trial: SpatialRobot, offset: Real) -> Real:
        parts = [
            modes_at(trial, case.q + offset).frequencies[: len(case.frequencies)] / case.frequencies - 1
            for case in found
        ]
        return np.concatenate(parts) / relative_error

    nominal = deviations(robot, np.zeros(len(robot.mechanism.moving)))
    causes = [Cause("as modelled", 1.0, 0.0, float(nominal @ nominal), n_data)]
    for change in possible_changes(robot, payload_at=np.zeros(3)):
        if change.kind in ("damping", "tool") or change.name == _BLIND:
            continue
        causes.append(Cause(change.name, *_fit(partial(_of_change, deviations, robot, change), change), n_data))
    return tuple(sorted(causes, key=lambda cause: cause.chi_square))


def equivalent_causes(causes: Sequence[Cause]) -> tuple[Cause, ...]:
    """The best cause, and those that the data cannot tell from it."""
    return tuple(cause for cause in causes if cause.chi_square <= causes[0].chi_square + AS_GOOD)


def _of_change(deviations: Callable[[SpatialRobot, Real], Real], robot: SpatialRobot, change: Change, x: Real) -> Real:
    return deviations(*change.apply(robot, change.from_fit(float(x[0]))))


def _fit(residuals: Callable[[Real], Real], change: Change) -> tuple[float, float, float]:
    """Number, its standard error and chi^2, from the best of the change's starts."""
    bounds = [change.to_fit(bound) for bound in change.bounds]
    start = min((change.to_fit(value) for value in change.values[::2]), key=lambda x: _size(residuals, x))
    scale = 0.1 if change.logarithmic or change.scale else 0.01
    found = scipy.optimize.least_squares(residuals, [start], bounds=bounds, x_scale=scale, max_nfev=15, xtol=1e-6)
    slope = float(np.sqrt(found.jac[:, 0] @ found.jac[:, 0]))
    number, chi_square = change.from_fit(float(found.x[0])), float(found.fun @ found.fun)
    error = np.inf if slope == 0 else change.slope(number) / slope
    return number, float(error), chi_square


def _size(residuals: Callable[[Real], Real], x: float) -> float:
    left = residuals(np.array([x]))
    return float(left @ left)
