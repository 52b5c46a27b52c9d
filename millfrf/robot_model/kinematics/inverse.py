"""Inverse kinematics: all branches of a spherical wrist in closed form, and an iterative search for any open chain."""

from dataclasses import replace

import numpy as np
import scipy

from millfrf.core import InputError, Real

from ..settings import ROBOT
from .mechanism import Frame, Mechanism, close_loops, rotation_vector, tool_jacobian

ROUNDING = 1e-12  # m and rad; below it axes meet or are parallel: rounding of the numbers in a robot file


def wrist_solutions(mechanism: Mechanism, target: Real) -> Real:
    """Find every posture within the limits that brings the tool to ``target``, up to 8.

    Joints 1 to 3 follow from the position (shoulder left or right, elbow up or down), joints 4 to 6 from the attitude
    (wrist flipped or not): Pieper 1968; Khalil & Dombre, Modeling, Identification and Control of Robots, section 4.2.
    In a singular posture of the wrist the fourth joint is set to zero.

    Parameters
    ----------
    mechanism
        Modified Denavit-Hartenberg frames with ``alpha = (0, +-90, 0, +-90, +-90, +-90) deg`` and the axes of joints 4,
        5 and 6 through one point.
    target : (4, 4)
        Tool frame in the base frame.

    Returns
    -------
    (n_solutions, 6), rad; empty if the target is out of reach or every branch passes a limit

    Raises
    ------
    InputError
        Another kind of robot.
    """
    base, frames, tool = _six_frames(mechanism)
    flange = np.linalg.inv(base) @ target @ np.linalg.inv(tool)
    centre = flange[:3, 3] - flange[:3, :3] @ np.array([0.0, 0.0, frames[5].r])
    branches = []
    for theta1 in _first_angles(frames, centre):
        for theta2, theta3 in _arm_angles(frames, centre, theta1):
            upper = np.eye(3)
            for frame, theta in zip(frames[:3], (theta1, theta2, theta3), strict=True):
                upper = upper @ frame.transform(theta - frame.theta)[:3, :3]
            branches += [(theta1, theta2, theta3, *wrist) for wrist in _wrist_angles(frames, upper.T @ flange[:3, :3])]
    within = [_within_limits(frames, np.array(angles)) for angles in branches]
    return np.array([q for q in within if q is not None]).reshape(-1, 6)


def nearest_solution(mechanism: Mechanism, target: Real, near: Real) -> Real | None:
    """Return the branch whose largest joint motion from ``near`` (6,) is smallest; None if there is no branch."""
    solutions = wrist_solutions(mechanism, target)
    if not len(solutions):
        return None
    return np.asarray(solutions[np.argmin(np.abs(solutions - near).max(axis=1))])


def _six_frames(mechanism: Mechanism) -> tuple[Real, tuple[Frame, ...], Real]:
    """Return the transformation before the first joint, the frames of six joints, and the transformation after them."""
    if not has_spherical_wrist(mechanism):
        raise InputError(
            "this robot has no spherical wrist on a shoulder and elbow (six revolute joints), which maps over places "
            "need; compute single postures instead: inverse_kinematics in Python, --joints or --at on the command line"
        )
    first = mechanism.moving[0]
    base, tool = np.eye(4), np.eye(4)
    for frame in mechanism.frames[:first]:
        base = base @ frame.transform(0.0)
    for frame in mechanism.frames[first + 6 :]:
        tool = tool @ frame.transform(0.0)
    return base, mechanism.frames[first : first + 6], tool


def has_spherical_wrist(mechanism: Mechanism) -> bool:
    """Check whether the robot has the frames that `wrist_solutions` needs."""
    joints = mechanism.joints
    if len(joints) != 6:
        return False
    before = ("0", *(frame.name for frame in mechanism.frames[:-1]))
    return bool(
        all(frame.antecedent == name for frame, name in zip(mechanism.frames, before, strict=True))
        and joints == mechanism.frames[mechanism.moving[0] : mechanism.moving[0] + 6]
        and all(frame.motion == "revolute" and frame.gamma == 0 for frame in joints)
        and all(abs(abs(joints[i].alpha) - np.pi / 2) < ROUNDING for i in (1, 3, 4, 5))
        and all(abs(joints[i].alpha) < ROUNDING for i in (0, 2))
        and all(abs(length) < ROUNDING for length in (joints[0].d, joints[4].d, joints[5].d, joints[4].r))
        and all(frame.b == 0 for frame in joints[1:])
    )


def _first_angles(frames: tuple[Frame, ...], centre: Real) -> list[float]:
    """Solve ``-x sin theta_1 + y cos theta_1 = lateral offset`` for theta_1, rad."""
    lateral = -np.sign(frames[1].alpha) * (frames[1].r + frames[2].r)
    distance = np.hypot(centre[0], centre[1])
    if distance < abs(lateral) or distance < ROUNDING:
        return []
    heading, turn = np.arctan2(centre[1], centre[0]), np.arcsin(lateral / distance)
    return [heading - turn, heading + np.pi + turn]


def _arm_angles(frames: tuple[Frame, ...], centre: Real, theta1: float) -> list[tuple[float, float]]:
    """Solve ``u^2 + v^2 = a^2 + f^2 + 2 a f cos(theta_3 + phi)``, two links in a plane; return theta_2 and theta_3."""
    side = np.sign(frames[1].alpha)
    u = centre[0] * np.cos(theta1) + centre[1] * np.sin(theta1) - frames[1].d
    v = side * (centre[2] - frames[0].r - frames[0].b)
    upper = frames[2].d
    forearm = np.array([frames[3].d, -frames[3].r * np.sign(frames[3].alpha)])
    length, phi = np.hypot(*forearm), np.arctan2(forearm[1], forearm[0])
    cosine = (u**2 + v**2 - upper**2 - length**2) / (2 * upper * length)
    if abs(cosine) > 1:
        return []
    solutions = []
    for bend in (np.arccos(cosine), -np.arccos(cosine)):
        theta2 = np.arctan2(v, u) - np.arctan2(length * np.sin(bend), upper + length * np.cos(bend))
        solutions.append((float(theta2), float(bend - phi)))
    return solutions


def _wrist_angles(frames: tuple[Frame, ...], rotation: Real) -> list[tuple[float, float, float]]:
    """Compute the angles of joints 4, 5 and 6, rad, from the attitude of frame 6 in frame 3."""
    s4, s5, s6 = (float(np.sign(frame.alpha)) for frame in frames[3:])
    turned = np.array([[1, 0, 0], [0, 0, s4], [0, -s4, 0]]) @ rotation
    sine = float(np.hypot(turned[0, 2], turned[1, 2]))
    cosine = -s5 * s6 * turned[2, 2]
    if sine < 1e-9:
        # axes 4 and 6 are one line: A = Rz(theta_4) M(0 or pi) Rz(theta_6) with theta_4 at its zero
        theta4, theta5 = frames[3].theta, (0.0 if cosine > 0 else np.pi)
        about_x5 = np.array([[1, 0, 0], [0, 0, -s5], [0, s5, 0]])
        about_x6 = np.array([[1, 0, 0], [0, 0, -s6], [0, s6, 0]])
        last = (about_x5 @ _about_z(theta5) @ about_x6).T @ _about_z(-theta4) @ turned
        return [(theta4, theta5, float(np.arctan2(last[1, 0], last[0, 0])))]
    solutions = []
    for sign in (1.0, -1.0):
        theta4 = np.arctan2(sign * s6 * turned[1, 2], sign * s6 * turned[0, 2])
        theta6 = np.arctan2(-sign * s5 * turned[2, 1], sign * s5 * turned[2, 0])
        solutions.append((float(theta4), float(np.arctan2(sign * sine, cosine)), float(theta6)))
    return solutions


def _about_z(angle: float) -> Real:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _within_limits(frames: tuple[Frame, ...], theta: Real) -> Real | None:
    """Add whole turns so that each joint is within its limits and nearest to zero; None if a joint cannot be."""
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


def inverse_kinematics(mechanism: Mechanism, target: Real, start: Real) -> Real:
    """Find joint values (n_moving,) that bring the tool to ``target``, near the driven values ``start``.

    Levenberg-Marquardt method on position (m) and rotation vector (rad) together (Nakamura & Hanafusa 1986). Closed
    loops are closed in every step.

    Parameters
    ----------
    mechanism
        Mechanism with its driven joints.
    target : (4, 4)
        Required tool frame in the base frame.
    start : (n_active,), rad or m
        Driven joint values to start from.

    Raises
    ------
    InputError
        The target is not reached from there.
    """
    driven, damping = np.array(start, dtype=float), 1e-6
    q = close_loops(mechanism, driven)
    error = _error(mechanism, q, target)
    for _ in range(200):
        if np.abs(error).max() < ROBOT.iterated_error:
            return q
        jacobian = tool_jacobian(mechanism, q)
        normal = jacobian.T @ jacobian
        step = np.linalg.solve(normal + damping * np.eye(len(normal)), jacobian.T @ error)
        trial = driven + np.clip(step, -0.3, 0.3)  # short steps stay on the branch of the start
        try:
            q_trial = close_loops(mechanism, trial, q[~mechanism.active])
        except InputError:  # the step leaves the range of the loop: try a shorter one
            damping *= 10
            continue
        trial_error = _error(mechanism, q_trial, target)
        if trial_error @ trial_error < error @ error:
            driven, q, error, damping = trial, q_trial, trial_error, max(damping / 10, 1e-14)
        else:
            damping *= 10
    raise InputError(
        f"the tool does not reach {np.round(target[:3, 3], 4).tolist()} m in that attitude from the given start "
        f"(error {np.abs(error).max():.2g}); give a nearer start or another attitude"
    )


def _error(mechanism: Mechanism, q: Real, target: Real) -> Real:
    tool = mechanism.tool_transform(q)
    return np.concatenate([target[:3, 3] - tool[:3, 3], rotation_vector(target[:3, :3] @ tool[:3, :3].T)])


def reach(mechanism: Mechanism, target: Real, start: Real, *, starts: int = ROBOT.reaching_starts) -> Real:
    """Find the posture within the joint limits that brings the tool to ``target`` with the least motion.

    The Levenberg-Marquardt method holds a joint that pushes against its limit there (active set; Nakamura & Hanafusa
    1986). It begins at ``start`` and at the points of a Halton sequence over the joints' ranges. More than six joints
    are then moved back towards ``start`` while the tool stays in place: ``q += (I - J^+ J)(start - q)`` (Liegeois
    1977).

    Parameters
    ----------
    mechanism
        Mechanism without closed loops.
    target : (4, 4)
        Required tool frame in the base frame.
    start : (n_moving,), rad or m
        Posture from which motion is counted.
    starts
        Number of starts after the given one.

    Returns
    -------
    (n_moving,), the posture whose largest joint motion from ``start`` is smallest

    Raises
    ------
    InputError
        Closed loops, or a target that no start reaches; the message says how near the tool comes.
    """
    postures = all_postures(mechanism, target, start, starts=starts)
    if not len(postures):
        raise InputError(_out_of_reach(mechanism, target, start, starts))
    return np.asarray(postures[np.argmin(np.abs(postures - start).max(axis=1))])


def all_postures(mechanism: Mechanism, target: Real, start: Real, *, starts: int) -> Real:
    """Find the different postures within the limits at which the search ends from several starts, (n, n_moving)."""
    postures: list[Real] = []
    for number, first in enumerate(_starts(mechanism, start, starts)):
        q, error = _descend(mechanism, target, first)
        if error > ROBOT.reached_error:
            continue
        q = _back_to(mechanism, target, _fewest_turns(mechanism, q, start), start)
        if all(np.abs(q - other).max() > ROBOT.same_posture for other in postures):
            postures.append(q)
        if number == 0 and len(mechanism.moving) > 6:
            break  # a redundant robot has infinitely many postures: only the one nearest to the start is needed
    return np.array(postures).reshape(-1, len(mechanism.moving))


def _out_of_reach(mechanism: Mechanism, target: Real, start: Real, starts: int) -> str:
    """Write an error message with the smallest error that is reached, and the joints at a limit in that posture."""
    trials = [_descend(mechanism, target, first) for first in _starts(mechanism, start, starts)]
    q = min(trials, key=lambda pair: pair[1])[0]
    error = _error(mechanism, q, target)
    margins = np.minimum(q - mechanism.bounds[0], mechanism.bounds[1] - q)
    at_limit = [frame.name for frame, margin in zip(mechanism.joints, margins, strict=True) if margin < 1e-6]
    limits = f"; joint {', '.join(at_limit)} is at its limit there" if at_limit else ""
    return (
        f"the tool does not reach {np.round(target[:3, 3], 4).tolist()} m in that attitude: it comes within "
        f"{1e3 * np.linalg.norm(error[:3]):.3g} mm and {np.degrees(np.linalg.norm(error[3:])):.3g} degrees{limits}; "
        "move or turn the cut"
    )


def _starts(mechanism: Mechanism, start: Real, count: int) -> Real:
    """List the given start and ``count`` points of a Halton sequence over the joint ranges; equal at every call."""
    if mechanism.closures:
        raise InputError("this search is for open chains only; use inverse_kinematics for a robot with closed loops")
    ranges = np.array([_range(frame, value) for frame, value in zip(mechanism.joints, start, strict=True)])
    # the first point of the sequence is zero, the corner of the range
    spread = scipy.stats.qmc.Halton(len(ranges), scramble=False).random(count + 1)[1:]
    lower, upper = mechanism.bounds
    return np.vstack([np.clip(start, lower, upper), ranges[:, 0] + spread * (ranges[:, 1] - ranges[:, 0])])


def _range(frame: Frame, value: float) -> tuple[float, float]:
    half = ROBOT.unlimited_travel if frame.motion == "prismatic" else np.pi
    lower = frame.lower if np.isfinite(frame.lower) else value - half
    upper = frame.upper if np.isfinite(frame.upper) else value + half
    if frame.motion == "revolute" and lower <= -half and upper >= half:
        return -half, half  # one turn contains every attitude
    return lower, upper


def _descend(mechanism: Mechanism, target: Real, first: Real) -> tuple[Real, float]:
    """Search from ``first``; return the posture and its largest error, m or rad.

    Joints that push against a limit are held there.
    """
    lower, upper = mechanism.bounds
    tool = mechanism.index(mechanism.tool)
    q, damping = np.clip(first, lower, upper), 1e-4
    error = _error(mechanism, q, target)
    for _ in range(80):
        if np.abs(error).max() < 1e-12:
            break
        jacobian = mechanism.jacobian(mechanism.transforms(q), tool)
        slope = jacobian.T @ error
        free = ~(((q <= lower) & (slope < 0)) | ((q >= upper) & (slope > 0)))
        reduced = jacobian[:, free]
        step = np.zeros(len(q))
        step[free] = np.linalg.solve(reduced.T @ reduced + damping * np.eye(int(free.sum())), slope[free])
        trial = np.clip(q + np.clip(step, -0.5, 0.5), lower, upper)
        trial_error = _error(mechanism, trial, target)
        gain = error @ error - trial_error @ trial_error
        if gain > 0:
            converged = gain < 1e-14 * (error @ error)
            q, error, damping = trial, trial_error, max(damping / 10, 1e-12)
            if converged:
                break
        else:
            damping *= 10
            if damping > 1e6:  # steps have become too short to change anything
                break
    return q, float(np.abs(error).max())


def _back_to(mechanism: Mechanism, target: Real, q: Real, start: Real) -> Real:
    """Move the joints of a redundant robot towards the start while the tool stays in place."""
    if len(q) <= 6:
        return q
    tool = mechanism.index(mechanism.tool)
    for _ in range(20):
        jacobian = mechanism.jacobian(mechanism.transforms(q), tool)
        towards = (start - q) - np.linalg.pinv(jacobian) @ (jacobian @ (start - q))
        if np.abs(towards).max() < 1e-9:
            break
        trial, error = _descend(mechanism, target, q + towards)  # the null space is linear only near q
        if error > ROBOT.reached_error or np.linalg.norm(trial - start) > np.linalg.norm(q - start) - 1e-12:
            break
        q = trial
    return q


def _fewest_turns(mechanism: Mechanism, q: Real, start: Real) -> Real:
    """Add whole turns to revolute joints, within the limits, so that each joint moves least from the start."""
    chosen = q.copy()
    for place, frame in enumerate(mechanism.joints):
        if frame.motion != "revolute":
            continue
        turns = 2 * np.pi * np.arange(-3, 4) + q[place]
        allowed = turns[(turns >= frame.lower - 1e-12) & (turns <= frame.upper + 1e-12)]
        if len(allowed):
            chosen[place] = allowed[np.argmin(np.abs(allowed - start[place]))]
    return chosen


def tool_postures(mechanism: Mechanism, target: Real, near: Real | None = None) -> Real:
    """Find postures within the limits that bring the tool to ``target``, (n, n_moving); empty if there is none.

    A robot with a spherical wrist has up to 8 postures in closed form. If rounded numbers (1.5708 for a quarter turn)
    make the wrist slightly imperfect, the closed form gives start values, from which the exact postures are searched.
    For other robots the search starts from ``near`` and from points over the joint ranges. It may miss a branch; its
    postures are sorted by their motion from ``near``.

    Parameters
    ----------
    mechanism
        Mechanism of the robot, an open chain.
    target : (4, 4)
        Required tool frame in the base frame.
    near : (n_moving,), rad or m
        Posture from which motion is counted; None: the middle of the joint ranges.
    """
    if mechanism.closures or has_spherical_wrist(mechanism):  # wrist_solutions refuses closed loops
        return wrist_solutions(mechanism, target)
    ideal = _rounded(mechanism)
    if has_spherical_wrist(ideal):
        # limits a little wider, so that rounding loses no posture at a limit
        tolerance = ROBOT.wrist_rounding
        frames = tuple(replace(f, lower=f.lower - tolerance, upper=f.upper + tolerance) for f in ideal.frames)
        starts = wrist_solutions(replace(ideal, frames=frames), target)
        corrected = [_descend(mechanism, target, first) for first in starts]
        reached = [q for q, error in corrected if error <= ROBOT.reached_error]
        return np.array(reached).reshape(-1, len(mechanism.moving))
    start = _middle(mechanism) if near is None else near
    postures = all_postures(mechanism, target, start, starts=ROBOT.branch_starts)
    return np.asarray(postures[np.argsort(np.abs(postures - start).max(axis=1))]) if len(postures) else postures


def _rounded(mechanism: Mechanism) -> Mechanism:
    """Return the mechanism with nearly right angles set to right angles, and nearly zero lengths set to zero."""

    def right(angle: float) -> float:
        quarter = np.pi / 2 * round(angle / (np.pi / 2))
        return float(quarter) if abs(angle - quarter) < ROBOT.wrist_rounding else angle

    def clean(frame: Frame) -> Frame:
        if frame.motion == "fixed":
            return frame
        lengths = {name: 0.0 for name in ("b", "d", "r") if abs(getattr(frame, name)) < ROBOT.wrist_rounding}
        gamma = 0.0 if abs(frame.gamma) < ROBOT.wrist_rounding else frame.gamma
        return replace(frame, alpha=right(frame.alpha), gamma=gamma, **lengths)  # type: ignore[arg-type]

    return replace(mechanism, frames=tuple(clean(frame) for frame in mechanism.frames))


def _middle(mechanism: Mechanism) -> Real:
    lower, upper = mechanism.bounds
    limited = np.isfinite(lower) & np.isfinite(upper)
    return np.where(limited, (np.where(limited, lower, 0.0) + np.where(limited, upper, 0.0)) / 2, 0.0)
