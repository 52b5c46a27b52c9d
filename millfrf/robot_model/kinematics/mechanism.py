"""Mechanisms: frames, loops and Jacobians, and joint values in the units that users write."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import InputError, Real

from ..settings import ROBOT

MOTIONS = ("revolute", "prismatic", "fixed")


@dataclass(frozen=True)
class Frame:
    """A frame fixed to a body: its place in the frame before it, and its motion against that frame.

    ``T = Rot(z, gamma) Trans(z, b) Rot(x, alpha) Trans(x, d) Rot(z, theta) Trans(z, r)`` (Khalil & Kleinfinger 1986;
    Belchior et al. 2013, Eq. 1). gamma = b = 0 gives the modified Denavit-Hartenberg frames of an open chain.

    Parameters
    ----------
    name, antecedent
        Name of the frame, and name of the earlier frame on which it stands; "0" is the base.
    motion
        ``revolute`` (q is added to theta), ``prismatic`` (q is added to r) or ``fixed``.
    active
        Whether a motor drives the joint; a moving frame without motor follows from the closed loops.
    gamma, b, alpha, d, theta, r
        Angles in rad and lengths in m of the transformation.
    lower, upper
        Limits of q, rad or m.

    Raises
    ------
    InputError
        An unknown motion, or limits that are not increasing.
    """

    name: str
    antecedent: str
    motion: str = "revolute"
    active: bool = True
    gamma: float = 0.0
    b: float = 0.0
    alpha: float = 0.0
    d: float = 0.0
    theta: float = 0.0
    r: float = 0.0
    lower: float = -np.inf
    upper: float = np.inf

    def __post_init__(self) -> None:
        if self.motion not in MOTIONS:
            raise InputError(f"frame {self.name}: motion {self.motion!r} is none of {', '.join(MOTIONS)}")
        if not self.lower < self.upper:
            raise InputError(f"frame {self.name}: limits {self.lower:g} to {self.upper:g} are not increasing")

    def transform(self, q: float) -> Real:
        """Return the homogeneous matrix (4, 4) from this frame to its antecedent at the joint value q, rad or m."""
        theta = self.theta + (q if self.motion == "revolute" else 0.0)
        r = self.r + (q if self.motion == "prismatic" else 0.0)
        cg, sg, ca, sa = np.cos(self.gamma), np.sin(self.gamma), np.cos(self.alpha), np.sin(self.alpha)
        ct, st = np.cos(theta), np.sin(theta)
        return np.array(
            [
                [cg * ct - sg * ca * st, -cg * st - sg * ca * ct, sg * sa, self.d * cg + r * sg * sa],
                [sg * ct + cg * ca * st, -sg * st + cg * ca * ct, -cg * sa, self.d * sg - r * cg * sa],
                [sa * st, sa * ct, ca, r * ca + self.b],
                [0.0, 0.0, 0.0, 1.0],
            ]
        )


def drive_direction(frame: Frame) -> int:
    """Return the index of a joint's motion in ``(K_r, K_r, K_a, K_rr, K_rr, K_ar)``: 5 (about z) or 2 (along z)."""
    return 2 if frame.motion == "prismatic" else 5


@dataclass(frozen=True)
class Mechanism:
    """A tree of frames, with pairs of frames that closed loops hold together.

    Parameters
    ----------
    frames
        Frames of the tree, each listed after its antecedent.
    tool
        Name of the frame at the tool tip.
    closures
        Pairs of frame names that coincide where a loop was cut.

    Raises
    ------
    InputError
        A repeated name, an antecedent that comes later, a closure or tool that names no frame, or a passive frame
        without a closed loop.
    """

    frames: tuple[Frame, ...]
    tool: str
    closures: tuple[tuple[str, str], ...] = ()

    def __post_init__(self) -> None:
        seen = {"0"}
        for frame in self.frames:
            if frame.antecedent not in seen:
                raise InputError(
                    f"frame {frame.name} stands on {frame.antecedent!r}, which is not before it; list frames from the "
                    "base on"
                )
            if frame.name in seen:
                raise InputError(f"two frames are named {frame.name!r}; name each once")
            seen.add(frame.name)
        for name in (self.tool, *(name for pair in self.closures for name in pair)):
            if name not in seen:
                raise InputError(f"there is no frame {name!r}; the frames are {', '.join(sorted(seen))}")
        passive = [frame.name for frame in self.frames if frame.motion != "fixed" and not frame.active]
        if passive and not self.closures:
            raise InputError(f"frame {passive[0]} is passive, but no closed loop moves it; make it active, or fixed")

    @cached_property
    def moving(self) -> tuple[int, ...]:
        """Indices of the moving frames, in the order of the joint vector q."""
        return tuple(i for i, frame in enumerate(self.frames) if frame.motion != "fixed")

    @cached_property
    def joints(self) -> tuple[Frame, ...]:
        """Moving frames, in the order of the joint vector q."""
        return tuple(self.frames[index] for index in self.moving)

    @property
    def bounds(self) -> tuple[Real, Real]:
        """Lower and upper joint limits, each (n_moving,), rad or m."""
        return np.array([frame.lower for frame in self.joints]), np.array([frame.upper for frame in self.joints])

    @cached_property
    def active(self) -> NDArray[np.bool_]:
        """Mask (n_moving,) of the driven entries of q."""
        return np.array([frame.active for frame in self.joints])

    @cached_property
    def body_of(self) -> dict[str, str]:
        """Return the body of each frame; a body has the name of one of its frames, ``"0"`` is the base.

        Fixed frames, and frames that a closure holds together, belong to one body.
        """
        body = {"0": "0"}
        for frame in self.frames:
            body[frame.name] = body[frame.antecedent] if frame.motion == "fixed" else frame.name
        for first, second in self.closures:
            merged, into = body[first], body[second]
            body = {name: into if owner == merged else owner for name, owner in body.items()}
        return body

    @cached_property
    def _parents(self) -> tuple[int, ...]:
        index = {frame.name: i for i, frame in enumerate(self.frames)} | {"0": -1}
        return tuple(index[frame.antecedent] for frame in self.frames)

    def index(self, name: str) -> int:
        """Index of a frame by name."""
        return next(i for i, frame in enumerate(self.frames) if frame.name == name)

    def transforms(self, q: Real) -> Real:
        """Compute all frames in the base frame, (n_frames, 4, 4), at the joint values q (n_moving,)."""
        if np.shape(q) != (len(self.moving),):
            raise InputError(f"{np.size(q)} joint values for {len(self.moving)} moving frames; give one each")
        values = np.zeros(len(self.frames))
        values[list(self.moving)] = q
        placed = np.empty((len(self.frames), 4, 4))
        for i, frame in enumerate(self.frames):
            local = frame.transform(float(values[i]))
            parent = self._parents[i]
            placed[i] = local if parent < 0 else placed[parent] @ local
        return placed

    def tool_transform(self, q: Real) -> Real:
        """Tool frame in the base frame, (4, 4)."""
        return np.asarray(self.transforms(q)[self.index(self.tool)])

    def jacobian(self, placed: Real, frame: int) -> Real:
        """Compute the derivative of a frame's position and rotation over q, (6, n_moving).

        ``placed`` is from :meth:`transforms`.
        """
        target = placed[frame, :3, 3]
        columns = np.zeros((6, len(self.moving)))
        ancestor = frame
        while ancestor >= 0:
            if ancestor in self.moving:
                column = self.moving.index(ancestor)
                axis = placed[ancestor, :3, 2]
                if self.frames[ancestor].motion == "revolute":
                    columns[:3, column] = _cross(axis, target - placed[ancestor, :3, 3])
                    columns[3:, column] = axis
                else:
                    columns[:3, column] = axis
            ancestor = self._parents[ancestor]
        return columns


def _cross(a: Real, b: Real) -> Real:
    # several times faster than numpy.cross, which handles any shape; the inverse kinematics call it in their inner loop
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def rotation_vector(rotation: Real) -> Real:
    """Compute the rotation vector (axis times angle), rad, (3,), of a rotation matrix (3, 3).

    Examples
    --------
    >>> quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    >>> rotation_vector(quarter).round(6).tolist()
    [0.0, 0.0, 1.570796]
    """
    return np.asarray(scipy.spatial.transform.Rotation.from_matrix(rotation).as_rotvec())


def close_loops(mechanism: Mechanism, driven: Real, start: Real | None = None) -> Real:
    """Compute all joint values (n_moving,) from the driven joint values; Newton's method closes the cut loops.

    Each closure requires equal origins and attitudes of two frames (Khalil & Kleinfinger 1986, section 4).

    Parameters
    ----------
    mechanism
        Mechanism with its closed loops.
    driven : (n_active,), rad or m
        Values of the driven joints.
    start : (n_passive,) or None
        Start values of the passive joints, which select the assembly; None: zeros.

    Raises
    ------
    InputError
        A wrong number of driven values, or a loop that does not close at them.
    """
    active = mechanism.active
    if np.shape(driven) != (int(active.sum()),):
        raise InputError(f"{np.size(driven)} joint values for {int(active.sum())} driven joints; give one each")
    q = np.zeros(len(active))
    q[active] = driven
    if not mechanism.closures:
        return q
    if start is not None:
        q[~active] = start
    for _ in range(50):
        placed = mechanism.transforms(q)
        gap = loop_gaps(mechanism, placed)
        if np.abs(gap).max() < ROBOT.closed_loop:
            return q
        step = np.linalg.lstsq(loop_jacobian(mechanism, placed)[:, ~active], -gap, rcond=None)[0]
        q[~active] += np.clip(step, -0.5, 0.5)  # a full step far from the solution may jump to the other assembly
    # rounding of long chains may keep the gap just above the goal
    if np.abs(gap).max() < 1e3 * ROBOT.closed_loop:
        return q
    raise InputError(
        f"a closed loop does not close at joint values {np.round(driven, 4).tolist()}; gap {np.abs(gap).max():.2g}"
    )


def loop_gaps(mechanism: Mechanism, placed: Real) -> Real:
    """Compute the differences of position (m) and attitude (rad) where loops were cut, (6 n_closures,)."""
    gaps = []
    for first, second in mechanism.closures:
        a, b = placed[mechanism.index(first)], placed[mechanism.index(second)]
        gaps += [a[:3, 3] - b[:3, 3], rotation_vector(a[:3, :3] @ b[:3, :3].T)]
    return np.concatenate(gaps)


def loop_jacobian(mechanism: Mechanism, placed: Real) -> Real:
    """Compute the derivative of the gaps over all joint values, (6 n_closures, n_moving); exact for closed loops."""
    pairs = [(mechanism.index(first), mechanism.index(second)) for first, second in mechanism.closures]
    return np.vstack([mechanism.jacobian(placed, a) - mechanism.jacobian(placed, b) for a, b in pairs])


def tool_jacobian(mechanism: Mechanism, q: Real) -> Real:
    """Compute the derivative of the tool's place over the driven joints with all loops closed, (6, n_active)."""
    placed = mechanism.transforms(q)
    jacobian = mechanism.jacobian(placed, mechanism.index(mechanism.tool))
    active = mechanism.active
    if not mechanism.closures:
        return jacobian[:, active]
    # the passive joints move such that the gaps stay closed: J_p dq_p = -J_a dq_a
    loops = loop_jacobian(mechanism, placed)
    passive_motion = np.linalg.lstsq(loops[:, ~active], -loops[:, active], rcond=None)[0]
    return np.asarray(jacobian[:, active] + jacobian[:, ~active] @ passive_motion)


def posture_warnings(mechanism: Mechanism, q: Real) -> tuple[str, ...]:
    """Return one warning for each joint beyond its limits, and one if the posture is near a singularity."""
    warnings = [
        _limit_warning(frame, float(value))
        for frame, value in zip(mechanism.joints, q, strict=True)
        if not frame.lower <= value <= frame.upper
    ]
    smallest = np.linalg.svd(tool_jacobian(mechanism, q), compute_uv=False)[-1]
    if smallest < ROBOT.near_singularity:
        warnings.append(f"the posture is near a singularity: smallest singular value {smallest:.2g}")
    return tuple(warnings)


def _limit_warning(frame: Frame, value: float) -> str:
    text = f"joint {frame.name} = {value:.4g} is outside {frame.lower:.4g} to {frame.upper:.4g}"
    if frame.motion == "prismatic":
        return f"{text} m"
    degrees = 180 / np.pi
    return f"{text} rad ({degrees * value:.1f} outside {degrees * frame.lower:.1f} to {degrees * frame.upper:.1f} deg)"


def joint_unit(frame: Frame) -> str:
    """Return ``deg`` for a revolute joint and ``m`` for a prismatic joint."""
    return "m" if frame.motion == "prismatic" else "deg"


def driven_values(mechanism: Mechanism, typed: Sequence[float]) -> Real:
    """Convert typed joint values to rad and m: degrees for revolute joints, metres for prismatic ones.

    Parameters
    ----------
    mechanism
        Mechanism whose joints are driven.
    typed : (n_active,)
        Typed values in the order of the driven frames.

    Raises
    ------
    InputError
        A wrong number of values, or a value out of range; the message names the joint and its unit.

    Examples
    --------
    >>> rail = Mechanism((Frame("rail", "0", motion="prismatic"), Frame("1", "rail")), "1")
    >>> driven_values(rail, [2.0, 90.0]).round(4).tolist()
    [2.0, 1.5708]
    """
    frames = _driven(mechanism)
    if len(typed) != len(frames):
        units = ", ".join(f"{frame.name} ({joint_unit(frame)})" for frame in frames)
        raise InputError(f"{len(typed)} joint values for {len(frames)} driven joints; give one each: {units}")
    return np.array([_in_si(frame, float(value)) for frame, value in zip(frames, typed, strict=True)], dtype=float)


def named_values(mechanism: Mechanism, typed: Sequence[tuple[str, Sequence[float]]]) -> dict[str, Real]:
    """Convert named postures to rad and m; a repeated name or a wrong value is an error that names the posture."""
    postures: dict[str, Real] = {}
    for name, values in typed:
        if name in postures:
            raise InputError(f"two postures are named {name!r}; name each once")
        try:
            postures[name] = driven_values(mechanism, values)
        except InputError as error:
            raise InputError(f"posture {name!r}: {error}") from error
    return postures


def typed_values(mechanism: Mechanism, driven: Real) -> Real:
    """Convert driven joint values (rad, m) to degrees and metres, (n_active,); the inverse of `driven_values`."""
    scale = np.array([1.0 if frame.motion == "prismatic" else 180 / np.pi for frame in _driven(mechanism)])
    return np.asarray(np.asarray(driven, dtype=float) * scale)


def shown_values(mechanism: Mechanism, driven: Real) -> str:
    """Format driven joint values (rad, m) in one line: ``0.0, -20.0 deg``, or ``2.000 m, 0.0 deg`` if units differ.

    Examples
    --------
    >>> rail = Mechanism((Frame("rail", "0", motion="prismatic"), Frame("1", "rail")), "1")
    >>> shown_values(rail, np.array([2.0, 0.5]))
    '2.000 m, 28.6 deg'
    """
    frames, values = _driven(mechanism), typed_values(mechanism, driven)
    if all(frame.motion != "prismatic" for frame in frames):
        return ", ".join(f"{value:.1f}" for value in values) + " deg"
    return ", ".join(
        f"{value:.3f} m" if frame.motion == "prismatic" else f"{value:.1f} deg"
        for frame, value in zip(frames, values, strict=True)
    )


def unit_warnings(mechanism: Mechanism, typed: Sequence[float]) -> tuple[str, ...]:
    """Warn in one sentence if typed angles look like radians: all small, and not all whole numbers.

    Examples
    --------
    >>> turning = Mechanism((Frame("1", "0"), Frame("2", "1")), "2")
    >>> len(unit_warnings(turning, [1.57, -0.35])), len(unit_warnings(turning, [90.0, -20.5]))
    (1, 0)
    """
    angles = [value for frame, value in zip(_driven(mechanism), typed, strict=False) if frame.motion != "prismatic"]
    # a single small angle is plausible in degrees, and so are whole numbers
    if len(angles) < 2 or all(float(value).is_integer() for value in angles):
        return ()
    largest = max(angles, key=abs)
    if abs(largest) > ROBOT.looks_like_radians:
        return ()
    return (
        f"no joint angle is larger than {abs(largest):.3g} degrees; if radians were meant, "
        f"{largest:.4g} rad is {np.degrees(largest):.4g} degrees",
    )


def _driven(mechanism: Mechanism) -> list[Frame]:
    return [frame for frame in mechanism.joints if frame.active]


def _in_si(frame: Frame, value: float) -> float:
    if frame.motion == "prismatic":
        if not abs(value) <= ROBOT.largest_travel:
            raise InputError(
                f"joint {frame.name} = {value:g}: a prismatic joint is given in metres, at most "
                f"{ROBOT.largest_travel:g}; {value:g} mm would be {1e-3 * value:g}"
            )
        return value
    if not abs(value) <= ROBOT.largest_angle:
        raise InputError(
            f"joint {frame.name} = {value:g}: a revolute joint is given in degrees, at most {ROBOT.largest_angle:g}; "
            "check the value and the order of the joints"
        )
    return float(np.radians(value))
