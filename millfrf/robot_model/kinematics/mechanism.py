"""`Mechanism`: frames of Khalil and Kleinfinger, for chains, trees and closed loops."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from millfrf.core import InputError, Real

MOTIONS = ("revolute", "prismatic", "fixed")


@dataclass(frozen=True)
class Frame:
    """One frame fixed to a body, and how it lies in and moves against the frame before it.

    ``T = Rot(z, gamma) Trans(z, b) Rot(x, alpha) Trans(x, d) Rot(z, theta) Trans(z, r)`` (Khalil & Kleinfinger 1986;
    Belchior et al. 2013, Eq. 1). gamma = b = 0 leaves the modified Denavit-Hartenberg frames of an open chain.

    Parameters
    ----------
    name, antecedent
        ``antecedent`` is the name of an earlier frame, or "0": the base.
    motion
        ``revolute`` (theta grows by q), ``prismatic`` (r grows by q) or ``fixed``.
    active
        Driven by a motor; a moving frame that is not follows from the closed loops.
    gamma, b, alpha, d, theta, r
        rad and m.
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
        """Homogeneous matrix from this frame to its antecedent, shape (4, 4)."""
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
    """Place of a joint's own motion in ``(K_r, K_r, K_a, K_rr, K_rr, K_ar)``: 5 about z, 2 along z if prismatic."""
    return 2 if frame.motion == "prismatic" else 5


@dataclass(frozen=True)
class Mechanism:
    """A tree of frames, with pairs of frames that closed loops hold together.

    Parameters
    ----------
    frames
        Each after its antecedent.
    tool
        Name of the frame at the tool tip.
    closures
        Pairs of frame names that coincide where a loop was cut.

    Raises
    ------
    InputError
        A name twice, an antecedent that comes later, or a closure or tool that names no frame.
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
        """Indices of the frames that move: the order of the joint vector q."""
        return tuple(i for i, frame in enumerate(self.frames) if frame.motion != "fixed")

    @cached_property
    def active(self) -> NDArray[np.bool_]:
        """Whether each entry of q is driven, shape (n_moving,)."""
        return np.array([self.frames[index].active for index in self.moving])

    @cached_property
    def body_of(self) -> dict[str, str]:
        """Body of each frame, by the name of one frame on it: fixed frames and closed cuts join what they hold.

        ``"0"`` is the base.
        """
        body = {"0": "0"}
        for frame in self.frames:
            body[frame.name] = body[frame.antecedent] if frame.motion == "fixed" else frame.name
        for first, second in self.closures:
            kept, merged = body[second], body[first]
            body = {name: kept if owner == merged else owner for name, owner in body.items()}
        return body

    @cached_property
    def _parents(self) -> tuple[int, ...]:
        index = {frame.name: i for i, frame in enumerate(self.frames)} | {"0": -1}
        return tuple(index[frame.antecedent] for frame in self.frames)

    def index(self, name: str) -> int:
        """Index of a frame by name."""
        return next(i for i, frame in enumerate(self.frames) if frame.name == name)

    def transforms(self, q: Real) -> Real:
        """Each frame in the base frame, shape (n_frames, 4, 4), from all joint values (n_moving,).

        Raises
        ------
        InputError
            Another number of joint values.
        """
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

    def jacobian(self, placed: Real, frame: int, point: Real | None = None) -> Real:
        """Velocity and rotation of a frame's origin, or of ``point`` fixed to it, over q; shape (6, n_moving)."""
        target = placed[frame, :3, 3] if point is None else point
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
    """``a x b`` of two vectors: several times quicker than NumPy's, which takes any shape."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def rotation_vector(rotation: Real) -> Real:
    """Axis times angle of a rotation matrix (3, 3), rad; for the difference of two attitudes.

    Examples
    --------
    >>> quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    >>> rotation_vector(quarter).round(6).tolist()
    [0.0, 0.0, 1.570796]
    """
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(rotation).as_rotvec())


_CLOSED = 1e-12
"""Largest gap of a loop that counts as closed, m and rad."""


def close_loops(mechanism: Mechanism, driven: Real, start: Real | None = None) -> Real:
    """Compute all joint values (n_moving,) from the driven ones, by Newton's method on the gaps of the cut joints.

    Each closure asks for equal origins and attitudes of two frames (Khalil & Kleinfinger 1986, section 4).

    Parameters
    ----------
    mechanism
        Mechanism with its closed loops.
    driven : (n_active,), rad or m
        Values of the driven joints.
    start : (n_passive,) or None
        Passive values to start from: they choose the assembly; None: zeros.

    Raises
    ------
    InputError
        Another number of driven values, or a loop that does not close there.
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
        if np.abs(gap).max() < _CLOSED:
            return q
        step = np.linalg.lstsq(loop_jacobian(mechanism, placed)[:, ~active], -gap, rcond=None)[0]
        q[~active] += np.clip(step, -0.5, 0.5)
    if np.abs(gap).max() < 1e3 * _CLOSED:
        return q
    raise InputError(
        f"a closed loop does not close at joint values {np.round(driven, 4).tolist()}; gap {np.abs(gap).max():.2g}"
    )


def loop_gaps(mechanism: Mechanism, placed: Real) -> Real:
    """Difference of position and attitude over each cut, shape (6 * n_closures,)."""
    gaps = []
    for first, second in mechanism.closures:
        a, b = placed[mechanism.index(first)], placed[mechanism.index(second)]
        gaps += [a[:3, 3] - b[:3, 3], rotation_vector(a[:3, :3] @ b[:3, :3].T)]
    return np.concatenate(gaps)


def loop_jacobian(mechanism: Mechanism, placed: Real) -> Real:
    """Derivative of the gaps over all joint values, near closure; shape (6 * n_closures, n_moving)."""
    pairs = [(mechanism.index(first), mechanism.index(second)) for first, second in mechanism.closures]
    return np.vstack([mechanism.jacobian(placed, a) - mechanism.jacobian(placed, b) for a, b in pairs])


def tool_jacobian(mechanism: Mechanism, q: Real) -> Real:
    """Velocity and rotation of the tool over the driven joints, loops kept closed; shape (6, n_active)."""
    placed = mechanism.transforms(q)
    whole = mechanism.jacobian(placed, mechanism.index(mechanism.tool))
    active = mechanism.active
    if not mechanism.closures:
        return whole[:, active]
    loops = loop_jacobian(mechanism, placed)
    follow = np.linalg.lstsq(loops[:, ~active], -loops[:, active], rcond=None)[0]
    return np.asarray(whole[:, active] + whole[:, ~active] @ follow)


def posture_warnings(mechanism: Mechanism, q: Real, least: float = 0.02) -> tuple[str, ...]:
    """Limits that are passed, and closeness to a singularity: one sentence each.

    A posture is near a singularity where the smallest singular value of the Jacobian (m, rad) is below ``least``.
    """
    warnings = []
    for index, value in zip(mechanism.moving, q, strict=True):
        frame = mechanism.frames[index]
        if not frame.lower <= value <= frame.upper:
            warnings.append(_outside(frame, float(value)))
    smallest = np.linalg.svd(tool_jacobian(mechanism, q), compute_uv=False)[-1]
    if smallest < least:
        warnings.append(f"the posture is near a singularity: smallest singular value {smallest:.2g}")
    return tuple(warnings)


def _outside(frame: Frame, value: float) -> str:
    text = f"joint {frame.name} = {value:.4g} is outside {frame.lower:.4g} to {frame.upper:.4g}"
    if frame.motion == "prismatic":
        return f"{text} m"
    degrees = 180 / np.pi
    return f"{text} rad ({degrees * value:.1f} outside {degrees * frame.lower:.1f} to {degrees * frame.upper:.1f} deg)"
