"""Hypothetical changes of a robot's model, and their fit to frequencies measured in several postures."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import scipy

from millfrf.core import InputError, Real

from ..finite_elements.statics import with_gravity
from ..settings import UPDATE
from ..spatial.spatial_modes import modes_at, tool_spring, with_tool_spring
from ..spatial.spatial_robot import SpatialRobot
from .changes import (
    Change,
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

FACTOR_BOUNDS = (0.05, 20.0)  # lowest and highest factor on a stiffness or on the damping
FACTOR_STARTS = tuple(np.geomspace(0.2, 5.0, 16).tolist())


def possible_changes(
    robot: SpatialRobot, *, payload_at: Real | None = None, rigid_links: bool = False
) -> tuple[Change, ...]:
    """List the changes that may explain a difference between a robot and its model.

    Joint stiffnesses, the links, a payload of either sign (negative: the spindle is lighter than modelled), the
    compliance of a rigid tool, the angles of driven joints, gravity (open chains whose model has none), and damping.

    Parameters
    ----------
    robot
        The robot as modelled.
    payload_at : (3,), m, or None
        Place of a payload from the tool tip, in the tool frame; None: it is unknown and fitted with the mass.
    rigid_links
        Whether the model is used with its links made rigid, so that their flexibility may have been left out.
    """
    changes = [
        _factor(f"joint {joint.frame} stiffness", "stiffness", partial(_with_joint, joint.frame))
        for joint in robot.joints
        if np.isfinite(joint.stiffness).any()
    ]
    if any(link.section is not None for link in robot.links):
        name = "link flexibility left out" if rigid_links else "links"
        starts = (*np.geomspace(0.05, 5.0, 12).tolist(), 100.0)
        changes.append(_factor(name, "links", with_link_factor, starts, (1e-2, 1e3)))
    changes.append(_payload(robot, payload_at))
    if tool_spring(robot) is None:
        axial = Companion("axial", "m/N", (0.0, 1e-4), 0.0, 2e-7, 1e-8)
        starts = tuple(np.geomspace(1e-8, 2e-6, 12).tolist())
        bounds, neutral = (1e-10, 1e-4), 1e-9
        changes.append(
            Change(
                "tool compliance", "tool", "m/N", True, starts, bounds, neutral, with_tool_spring, companions=(axial,)
            )
        )
    changes += _joint_offsets(robot)
    if not robot.gravity and not robot.mechanism.closures:
        changes.append(Change("gravity", "gravity", "m/s^2", True, (9.81,), (1.0, 20.0), 1.0, with_gravity))
    if robot.damping_ratio or any(robot.rayleigh):
        changes.append(_factor("damping", "damping", with_damping_factor))
    return tuple(changes)


def _factor(
    name: str,
    kind: str,
    apply: Callable[..., SpatialRobot],
    starts: tuple[float, ...] = FACTOR_STARTS,
    bounds: tuple[float, float] = FACTOR_BOUNDS,
) -> Change:
    return Change(name, kind, "", True, starts, bounds, 1.0, apply)


def unnamed_changes(robot: SpatialRobot) -> tuple[Change, ...]:
    """List factors on the masses of bodies: no diagnosis names them, but they widen the errors of named numbers.

    Parameters
    ----------
    robot
        The robot as modelled.
    """
    return tuple(
        _factor(f"mass of the body on node {body.node}", "mass", partial(_with_mass, index), bounds=(0.2, 5.0))
        for index, body in enumerate(robot.bodies)
        if body.mass > 0
    )


def _joint_offsets(robot: SpatialRobot) -> list[Change]:
    mechanism = robot.mechanism
    starts = tuple(np.radians([-8.0, -4.0, -2.0, -1.0, 1.0, 2.0, 4.0, 8.0]).tolist())
    frames = [(column, mechanism.frames[index]) for column, index in enumerate(mechanism.moving)]
    return [
        Change(f"posture of joint {frame.name}", "posture", "rad", False, starts, (-0.5, 0.5), 0.0, None, joint=column)
        for column, frame in frames
        if frame.active and frame.motion == "revolute"
    ]


def _payload(robot: SpatialRobot, payload_at: Real | None) -> Change:
    """Build the change by a mass at the tool end, of either sign; an unknown place becomes its companion numbers."""
    # at most nine tenths of the heaviest end body can be taken off, or the robot has no positive mass
    lightest = -0.9 * max((robot.bodies[i].mass for i in end_bodies(robot)), default=0.0)
    values = tuple(np.geomspace(0.5, 100.0, 14).tolist())
    values += tuple(share * lightest for share in (0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 0.9) if lightest)
    loaded = partial(_with_load, payload_at)
    places = () if payload_at is not None else _places(robot)
    return Change("payload", "payload", "kg", False, values, (lightest, 500.0), 0.0, loaded, 1.0, places)


def _places(robot: SpatialRobot) -> tuple[Companion, ...]:
    """Build the prior of a payload's place: between last axis and tip, sideways a quarter of their distance."""
    mechanism = robot.mechanism
    placed = mechanism.transforms(np.zeros(len(mechanism.moving)))
    tool, last = placed[mechanism.index(mechanism.tool)], placed[mechanism.moving[-1]]
    back = tool[:3, :3].T @ (last[:3, 3] - tool[:3, 3])
    reach = max(float(np.sqrt(back @ back)), 0.1)
    return tuple(
        Companion(f"place {axis} from the tip", "m", (middle - 1.0, middle + 1.0), middle, spread)
        for axis, middle, spread in zip("xyz", (back / 2).tolist(), (reach / 4, reach / 4, reach / 2), strict=True)
    )


def changed_robot(
    robot: SpatialRobot, changes: Sequence[Numbered], *, rigid_links: bool = False
) -> tuple[SpatialRobot, Real]:
    """Apply changes to a robot.

    Parameters
    ----------
    robot
        The robot as modelled.
    changes
        Changes and their numbers; each change is followed by its companions and their numbers.
    rigid_links
        Whether the links are rigid, unless one of the changes is the flexibility of links.

    Returns
    -------
    The changed robot, and the offset of its joints from the stated posture, rad, (n_moving,).
    """
    offset = np.zeros(len(robot.mechanism.moving))
    for position, (change, number) in enumerate(changes):
        if isinstance(change, Companion):
            continue
        if change.apply is None:
            offset[change.joint] += number
            continue
        own = [value for other, value in changes[position + 1 :] if other in change.companions]
        robot = change.apply(robot, number, *own)
    if rigid_links and all(isinstance(change, Companion) or change.kind != "links" for change, _ in changes):
        robot = with_rigid_links(robot)
    return robot, offset


# Functions of the module and `partial`, not closures, so that a change can be pickled.


def _with_joint(frame: str, robot: SpatialRobot, factor: float) -> SpatialRobot:
    return with_joint_factor(robot, frame, factor)


def _with_load(known: Real | None, robot: SpatialRobot, mass: float, *place: float) -> SpatialRobot:
    if mass == 0:
        return robot
    if known is None and not place:
        place = tuple(companion.neutral for companion in _places(robot))
    where = np.array(place) if known is None else known
    if mass > 0:
        return with_payload(robot, mass, where)
    return with_lighter_end(robot, -mass, None if known is not None else where)


def _with_mass(index: int, robot: SpatialRobot, factor: float) -> SpatialRobot:
    bodies = list(robot.bodies)
    bodies[index] = replace(bodies[index], mass=factor * bodies[index].mass, inertia=factor * bodies[index].inertia)
    return replace(robot, bodies=tuple(bodies))


@dataclass(frozen=True)
class PostureFrequencies:
    """Lowest natural frequencies measured in a posture: q (n_moving,), frequencies (n_modes,), Hz, rising."""

    q: Real
    frequencies: Real


@dataclass(frozen=True)
class Cause:
    """One explanation of measured frequencies: a change of the robot whose number is fitted to the frequencies."""

    name: str  # name of the change, or "as modelled" where nothing is changed
    parameter: float  # fitted number: a factor, kg, rad or m/s^2; 1 for "as modelled"
    standard_error: float  # infinite where the frequencies do not depend on the number; 0 for "as modelled"
    chi_square: float  # squared deviations in units of their expected error; near n_data for a correct explanation
    n_data: int  # number of frequencies compared


def explain_frequencies(
    robot: SpatialRobot, measured: Sequence[PostureFrequencies], relative_error: float = 0.005
) -> tuple[Cause, ...]:
    """Fit every single cause to measured frequencies; return them best first, ``as modelled`` among them.

    Each cause has one parameter, so the causes are compared by chi^2 alone; :func:`equivalent_causes` returns the
    causes that these postures do not separate from the best. One posture rarely separates joints; several postures do,
    because each loads the joints differently. A payload hangs at the tip. The tool's compliance and damping are not
    fitted, because the frequencies hardly depend on them.
    """
    n_data = sum(len(case.frequencies) for case in measured)
    if not n_data or not relative_error > 0:
        raise InputError(f"{n_data} frequencies with relative error {relative_error!r}: both must be positive")

    def deviations(trial: SpatialRobot, offset: Real) -> Real:
        parts = [
            modes_at(trial, case.q + offset).frequencies[: len(case.frequencies)] / case.frequencies - 1
            for case in measured
        ]
        return np.concatenate(parts) / relative_error

    nominal = deviations(*changed_robot(robot, ()))
    causes = [Cause("as modelled", 1.0, 0.0, float(nominal @ nominal), n_data)]
    for change in possible_changes(robot, payload_at=np.zeros(3)):
        # turning joint 1 turns the whole robot about the vertical and changes no frequency
        if change.kind not in ("damping", "tool") and change.name != "posture of joint 1":
            causes.append(Cause(change.name, *_fit(partial(_of_change, deviations, robot, change), change), n_data))
    return tuple(sorted(causes, key=lambda cause: cause.chi_square))


def equivalent_causes(causes: Sequence[Cause]) -> tuple[Cause, ...]:
    """Return the best cause, and all causes that the data do not separate from the best."""
    return tuple(cause for cause in causes if cause.chi_square <= causes[0].chi_square + UPDATE.equivalent_chi_square)


def _of_change(deviations: Callable[[SpatialRobot, Real], Real], robot: SpatialRobot, change: Change, x: Real) -> Real:
    return deviations(*changed_robot(robot, [(change, change.from_fit(float(x[0])))]))


def _fit(residuals: Callable[[Real], Real], change: Change) -> tuple[float, float, float]:
    """Fit a change from each of its start values; return number, standard error and chi^2 of the best fit."""
    bounds = [change.to_fit(bound) for bound in change.bounds]
    start = min((change.to_fit(value) for value in change.values[::2]), key=lambda x: _sum_of_squares(residuals, x))
    scale = 0.1 if change.logarithmic or change.scale else 0.01
    fit = scipy.optimize.least_squares(residuals, [start], bounds=bounds, x_scale=scale, max_nfev=15, xtol=1e-6)
    slope = float(np.sqrt(fit.jac[:, 0] @ fit.jac[:, 0]))
    number, chi_square = change.from_fit(float(fit.x[0])), float(fit.fun @ fit.fun)
    error = np.inf if slope == 0 else change.slope(number) / slope
    return number, float(error), chi_square


def _sum_of_squares(residuals: Callable[[Real], Real], x: float) -> float:
    deviations = residuals(np.array([x]))
    return float(deviations @ deviations)
