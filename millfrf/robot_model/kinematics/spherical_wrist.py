"""Inverse kinematics in closed form: six revolute joints, the last three through one point; all branches."""

import numpy as np

from millfrf.core import InputError, Real

from .mechanism import Frame, Mechanism

_QUARTER = np.pi / 2
_NOTHING = 1e-12
"""Lengths (m) and angles (rad) below which axes meet or are parallel: rounding of a file's numbers."""

_SINGULAR = 1e-9
"""|sin theta_5| below which axes 4 and 6 count as one line."""


def wrist_solutions(mechanism: Mechanism, target: Real) -> Real:
    """Every posture within the limits that brings the tool to ``target``, up to 8; shape (n_solutions, 6), rad.

    Position first (shoulder left or right, elbow up or down), then attitude (wrist flipped or not): Pieper 1968;
    Khalil & Dombre, Modeling, Identification and Control of Robots, section 4.2. Where the wrist is singular the
    fourth joint is put at zero.

    Parameters
    ----------
    mechanism
        Modified Denavit-Hartenberg frames with ``alpha = (0, +-90, 0, +-90, +-90, +-90) deg`` and the axes of joints 4,
        5 and 6 through one point.
    target : (4, 4)
        Tool frame in the base frame.

    Returns
    -------
    (n_solutions, 6), empty where the target is out of reach or every branch passes a limit

    Raises
    ------
    InputError
        Another kind of robot.
    """
    base, frames, tool = _six_frames(mechanism)
    flange = np.linalg.inv(base) @ target @ np.linalg.inv(tool)
    centre = flange[:3, 3] - flange[:3, :3] @ np.array([0.0, 0.0, frames[5].r])
    found = []
    for theta1 in _first(frames, centre):
        for theta2, theta3 in _second_and_third(frames, centre, theta1):
            upper = np.eye(3)
            for frame, theta in zip(frames[:3], (theta1, theta2, theta3), strict=True):
                upper = upper @ frame.transform(theta - frame.theta)[:3, :3]
            found += [(theta1, theta2, theta3, *wrist) for wrist in _wrist(frames, upper.T @ flange[:3, :3])]
    within = [_within(frames, np.array(angles)) for angles in found]
    kept = [q for q in within if q is not None]
    return np.array(kept).reshape(-1, 6)


def nearest_solution(mechanism: Mechanism, target: Real, near: Real) -> Real | None:
    """The branch whose largest joint motion from ``near`` (6,) is smallest, or None where there is none."""
    solutions = wrist_solutions(mechanism, target)
    if not len(solutions):
        return None
    return np.asarray(solutions[np.argmin(np.abs(solutions - near).max(axis=1))])


def _six_frames(mechanism: Mechanism) -> tuple[Real, tuple[Frame, ...], Real]:
    """What is fixed before the first joint, the six joints, and what is fixed after the last."""
    if not has_spherical_wrist(mechanism):
        raise InputError(
            "this robot has no spherical wrist on a shoulder and elbow (six revolute joints), which maps over places "
            "need; ask for single postures: inverse_kinematics in Python, --joints or --at on the command line"
        )
    first = mechanism.moving[0]
    base, tool = np.eye(4), np.eye(4)
    for frame in mechanism.frames[:first]:
        base = base @ frame.transform(0.0)
    for frame in mechanism.frames[first + 6 :]:
        tool = tool @ frame.transform(0.0)
    return base, mechanism.frames[first : first + 6], tool


def has_spherical_wrist(mechanism: Mechanism) -> bool:
    """Whether :func:`wrist_solutions` knows this kind of robot."""
    moving = [mechanism.frames[i] for i in mechanism.moving]
    before = ("0", *(frame.name for frame in mechanism.frames[:-1]))
    chain = all(frame.antecedent == name for frame, name in zip(mechanism.frames, before, strict=True))
    quarters = [moving[i].alpha if len(moving) == 6 else np.nan for i in (1, 3, 4, 5)]
    return bool(
        chain
        and len(moving) == 6
        and tuple(moving) == mechanism.frames[mechanism.moving[0] : mechanism.moving[0] + 6]
        and all(frame.motion == "revolute" and frame.gamma == 0 for frame in moving)
        and all(abs(abs(alpha) - _QUARTER) < 1e-12 for alpha in quarters)
        and all(abs(moving[i].alpha) < _NOTHING for i in (0, 2))
        and all(abs(length) < _NOTHING for length in (moving[0].d, moving[4].d, moving[5].d, moving[4].r))
        and all(frame.b == 0 for frame in moving[1:])
    )


def _first(frames: tuple[Frame, ...], centre: Real) -> list[float]:
    """``-x sin theta_1 + y cos theta_1 = lateral offset``."""
    lateral = -np.sign(frames[1].alpha) * (frames[1].r + frames[2].r)
    distance = np.hypot(centre[0], centre[1])
    if distance < abs(lateral) or distance < 1e-12:
        return []
    heading, turn = np.arctan2(centre[1], centre[0]), np.arcsin(lateral / distance)
    return [heading - turn, heading + np.pi + turn]


def _second_and_third(frames: tuple[Frame, ...], centre: Real, theta1: float) -> list[tuple[float, float]]:
    """Two links in the plane of the arm: ``u^2 + v^2 = a^2 + f^2 + 2 a f cos(theta_3 + phi)``."""
    side = np.sign(frames[1].alpha)
    u = centre[0] * np.cos(theta1) + centre[1] * np.sin(theta1) - frames[1].d
    v = side * (centre[2] - frames[0].r - frames[0].b)
    upper = frames[2].d
    forearm = np.array([frames[3].d, -frames[3].r * np.sign(frames[3].alpha)])
    reach, phi = np.hypot(*forearm), np.arctan2(forearm[1], forearm[0])
    cosine = (u**2 + v**2 - upper**2 - reach**2) / (2 * upper * reach)
    if abs(cosine) > 1:
        return []
    solutions = []
    for bend in (np.arccos(cosine), -np.arccos(cosine)):
        theta2 = np.arctan2(v, u) - np.arctan2(reach * np.sin(bend), upper + reach * np.cos(bend))
        solutions.append((float(theta2), float(bend - phi)))
    return solutions


def _wrist(frames: tuple[Frame, ...], rotation: Real) -> list[tuple[float, float, float]]:
    """Angles 4, 5 and 6 from the attitude of frame 6 in frame 3."""
    s4, s5, s6 = (float(np.sign(frame.alpha)) for frame in frames[3:])
    turned = np.array([[1, 0, 0], [0, 0, s4], [0, -s4, 0]]) @ rotation
    sine = float(np.hypot(turned[0, 2], turned[1, 2]))
    cosine = -s5 * s6 * turned[2, 2]
    if sine < _SINGULAR:
        # axes 4 and 6 are one line: A = Rz(theta_4) M(0 or pi) Rz(theta_6) with theta_4 at its zero
        theta4, theta5 = frames[3].theta, (0.0 if cosine > 0 else np.pi)
        middle = _middle(s5, s6, theta5)
        last = middle.T @ _about_z(-theta4) @ turned
        return [(theta4, theta5, float(np.arctan2(last[1, 0], last[0, 0])))]
    solutions = []
    for sign in (1.0, -1.0):
        theta4 = np.arctan2(sign * s6 * turned[1, 2], sign * s6 * turned[0, 2])
        theta6 = np.arctan2(-sign * s5 * turned[2, 1], sign * s5 * turned[2, 0])
        solutions.append((float(theta4), float(np.arctan2(sign * sine, cosine)), float(theta6)))
    return solutions


def _middle(s5: float, s6: float, theta5: float) -> Real:
    about_x5 = np.array([[1, 0, 0], [0, 0, -s5], [0, s5, 0]])
    about_x6 = np.array([[1, 0, 0], [0, 0, -s6], [0, s6, 0]])
    return np.asarray(about_x5 @ _about_z(theta5) @ about_x6)


def _about_z(angle: float) -> Real:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _within(frames: tuple[Frame, ...], theta: Real) -> Real | None:
    """Joint values with whole turns chosen to lie within the limits, nearest to zero; None where none does."""
    q = theta - np.array([frame.theta for frame in frames])
    chosen = []
    for value, frame in zip(q, frames, strict=True):
        base = (value + np.pi) % (2 * np.pi) - np.pi
        options = (base, base + 2 * np.pi, base - 2 * np.pi)
        allowed = [float(option) for option in options if frame.lower - 1e-9 <= option <= frame.upper + 1e-9]
        if not allowed:
            return None
        chosen.append(min(allowed, key=abs))
    return np.array(chosen)
