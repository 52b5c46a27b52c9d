"""Robot files of kind ``serial``: what is known, what is assumed, and what to measure."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from millfrf.core import InputError, Real

from ..kinematics.inverse import reach
from ..kinematics.mechanism import Mechanism, tool_jacobian
from ..spatial.spatial_robot import ElasticJoint, Link, LumpedBody, SpatialRobot
from .serial_chain import BASE, SerialChain, SerialJoint, axis_frames, fixed_frames, shift_and_angles, six_of

FLANGE, TOOL = "flange (fixed)", "tool (fixed)"
"""Names of the frames after the last joint."""


def spatial_robot(chain: SerialChain, **options: Any) -> SpatialRobot:
    """Build the robot: two nodes a joint, rigid bodies between them, the tip behind the last.

    Joint i has node 2 i - 1 on the body before and node 2 i on the body after it, both at its origin; node 0 is the
    clamped base, the last node the tool tip. Parts on the base are left out: they do not move.

    Parameters
    ----------
    chain
        Joints and parts.
    options
        Damping and gravity as :class:`SpatialRobot` takes them: ``rayleigh``, ``damping_ratio``, ``gravity``, ``up``.
    """
    built = axis_frames(chain.joints, chain.base)
    names = [joint.name for joint in chain.joints]
    last = built.bodies[names[-1]]
    flange = fixed_frames(FLANGE, names[-1], last @ chain.flange)
    tool = fixed_frames(TOOL, FLANGE, chain.tool)
    points: dict[int, tuple[str, Real]] = {0: ("0", np.zeros(3))}
    joints, links = [], []
    before, inside = "0", chain.base
    for number, joint in enumerate(chain.joints):
        first, second = 2 * number + 1, 2 * number + 2
        points[first] = (before, (inside @ joint.place)[:3, 3])
        points[second] = (joint.name, built.bodies[joint.name][:3, 3])
        joints.append(ElasticJoint(joint.name, (first, second), np.asarray(joint.stiffness, dtype=float)))
        links.append(Link((first - 1, first)))
        before, inside = joint.name, built.bodies[joint.name]
    tip = 2 * len(names) + 1
    points[tip] = (TOOL, np.zeros(3))
    links.append(Link((tip - 1, tip)))
    bodies = []
    for part in chain.parts:
        if part.joint == BASE:
            continue
        axes = built.bodies[part.joint]
        turn = axes[:3, :3]
        node = 2 * names.index(part.joint) + 2
        bodies.append(LumpedBody(node, part.joint, part.mass, turn @ part.centre, turn @ part.inertia @ turn.T))
    mechanism = Mechanism((*built.frames, *flange, *tool), TOOL)
    return SpatialRobot(mechanism, tuple(joints), tuple(links), tuple(bodies), points, tip, **options)


RAIL_STIFFNESS = (2e7, 2e8)
"""Rack-and-pinion or ball-screw drive of a linear axis, N/m."""


@dataclass(frozen=True)
class StiffnessClass:
    """Ranges for one class of robots.

    Parameters
    ----------
    payload : kg
        Largest payload of the class.
    arm : N m/rad
        Range of the first three revolute joints.
    wrist : N m/rad
        Range of the others.
    basis
        Where the range comes from.
    """

    payload: float
    arm: tuple[float, float]
    wrist: tuple[float, float]
    basis: str


CLASSES = (
    StiffnessClass(
        20.0, (1e4, 1e5), (3e3, 3e4), "strain-wave gears of sizes 14 to 32, torsional stiffness in catalogues"
    ),
    StiffnessClass(60.0, (1e5, 1e6), (2e4, 2e5), "between the two classes beside it; cycloidal gears"),
    StiffnessClass(300.0, (1e6, 5e6), (2e5, 1e6), "order identified on robots of 200 to 300 kg (Dumas et al. 2011)"),
    StiffnessClass(np.inf, (3e6, 2e7), (5e5, 5e6), "order of heavy robots of 500 kg and more (Jubien et al. 2014)"),
)


def class_of(payload: float) -> StiffnessClass:
    """Class of a rated payload, kg.

    Raises
    ------
    InputError
        A payload that is not positive.

    Examples
    --------
    >>> class_of(10.0).payload
    20.0
    """
    if not payload > 0:
        raise InputError(f"--rated-payload {payload:g}: give the robot's rated payload in kg")
    return next(entry for entry in CLASSES if payload <= entry.payload)


def typical(joints: Sequence[SerialJoint], entry: StiffnessClass) -> list[tuple[float, tuple[float, float]]]:
    """Middle (geometric mean) and range for each joint, N m/rad; N/m of prismatic joints."""
    found, turned = [], 0
    for joint in joints:
        span = RAIL_STIFFNESS
        if joint.motion == "revolute":
            span = entry.arm if turned < 3 else entry.wrist
            turned += 1
        found.append((float(np.sqrt(span[0] * span[1])), span))
    return found


@dataclass(frozen=True)
class Told:
    """Numbers with where they come from: what the maker of a file says of stiffness, spindle, damping.

    Parameters
    ----------
    stiffness
        For each joint its stiffness along its own motion, N m/rad or N/m, and its source.
    spindle
        Mass (kg), centre from the flange (m), inertia about it (3, 3), and source; or None.
    damping
        Damping ratio of all modes, and its source.
    origin
        Source of joints and bodies, in full.
    short
        The same in a word or two, for each table.
    tool
        Source of the tool tip's place.
    base
        Source of the base's place.
    posture
        Joint values of the first posture, degrees and metres, and its source.
    bodies
        Source of each part, where it is another than ``origin``.
    notes
        What a reader should know: one sentence each.
    """

    stiffness: Sequence[tuple[float, str]]
    spindle: tuple[float, Real, Real, str] | None
    damping: tuple[float, str]
    origin: str
    short: str
    tool: str
    base: str
    posture: tuple[Sequence[float], str]
    bodies: dict[str, str]
    notes: Sequence[str]


def chain_text(name: str, chain: SerialChain, told: Told) -> str:
    """TOML of a serial robot, with comments that say what to do next."""
    blocks = [_head(name, told), _place("base", chain.base, told.base)]
    blocks.append(_ranges())
    blocks += [_joint(joint, *own, told) for joint, own in zip(chain.joints, told.stiffness, strict=True)]
    for part in chain.parts:
        lines = ["[[bodies]]", f"name = {_text(part.name)}", f"joint = {_text(part.joint)}"]
        source = told.bodies.get(part.name, told.short)
        blocks.append(lines + _mass(part.mass, part.centre, part.inertia, source))
    blocks.append(_place("flange", chain.flange, told.short, "in the axes of the last joint's body"))
    blocks.append(_place("tool", chain.tool, told.tool, "tip of the tool in the axes of the flange; z along the tool"))
    if told.spindle is not None:
        mass, centre, inertia, source = told.spindle
        blocks.append(["# motor spindle, holder and tool together, in the axes of the flange", "[spindle]"])
        blocks[-1] += _mass(mass, centre, inertia, source)
    ratio, source = told.damping
    blocks.append(["[damping]", f"ratio = {ratio!r}", f"source = {_text(source)}"])
    values, source = told.posture
    blocks.append(["[[poses]]", 'name = "ready"', f"driven = {_list(values)}", f"source = {_text(source)}"])
    return "\n\n".join("\n".join(lines) for lines in blocks) + "\n"


def _head(name: str, told: Told) -> list[str]:
    notes = [f"# note: {note}" for note in told.notes]
    return [
        "# A serial robot: joints and bodies in a row; nodes are built from them. Every table says where its numbers",
        "# come from; `assumed` is named in the warnings of each result. Keys: docs/robot_files.md.",
        *notes,
        "",
        "[robot]",
        f"name = {_text(name)}",
        'kind = "serial"',
        f"source = {_text(told.origin)}",
    ]


def _ranges() -> list[str]:
    lines = ["# Joint stiffness in [joints.stiffness]. Orders of magnitude, N m/rad, arm (first three) and wrist:"]
    for entry in CLASSES:
        limit = f"up to {entry.payload:g} kg" if np.isfinite(entry.payload) else "above that"
        low, high = entry.arm
        lines.append(
            f"#   payload {limit}: arm {low:.0e} to {high:.0e}, wrist {entry.wrist[0]:.0e} to {entry.wrist[1]:.0e} "
            f"({entry.basis})"
        )
    return [*lines, f"#   linear axis: {RAIL_STIFFNESS[0]:.0e} to {RAIL_STIFFNESS[1]:.0e} N/m along it"]


def _joint(joint: SerialJoint, stiffness: float, source: str, told: Told) -> list[str]:
    sliding = joint.motion == "prismatic"
    lines = ["[[joints]]", f"name = {_text(joint.name)}", f'motion = "{joint.motion}"', *_shift(joint.place)]
    lines.append(f"axis = {_list(joint.axis)}")
    if np.isfinite([joint.lower, joint.upper]).all():
        limits = np.array([joint.lower, joint.upper])
        lines.append(f"limits_m = {_list(limits)}" if sliding else f"limits_deg = {_list(np.degrees(limits))}")
    lines += [f"source = {_text(told.short)}", "", "[joints.stiffness]"]
    lines.append(f"drive_{'n_per_m' if sliding else 'nm_per_rad'} = {float(stiffness)!r}")
    return [*lines, f"source = {_text(source)}"]


def _place(table: str, place: Real, source: str, comment: str = "") -> list[str]:
    return [*([f"# {comment}"] if comment else []), f"[{table}]", *_shift(place), f"source = {_text(source)}"]


def _shift(place: Real) -> list[str]:
    shift, angles = shift_and_angles(place)
    return [f"at_m = {_list(shift)}", f"turned_deg = {_list(np.degrees(angles))}"]


def _mass(mass: float, centre: Real, inertia: Real, source: str) -> list[str]:
    return [
        f"mass_kg = {float(mass)!r}",
        f"centre_m = {_list(centre)}",
        f"inertia_kg_m2 = {_list(six_of(inertia))}  # xx, yy, zz, xy, xz, yz",
        f"source = {_text(source)}",
    ]


def _list(values: Sequence[float] | Real) -> str:
    return "[" + ", ".join(repr(float(value) + 0.0) for value in values) + "]"


def _text(text: str) -> str:
    """A TOML string: quotes and control characters escaped."""
    import json

    return json.dumps(text, ensure_ascii=False)


def ready_posture(mechanism: Mechanism, tries: int = 400) -> tuple[Real, bool]:
    """Look for a well-conditioned posture with a vertical tool.

    Of a Halton sequence over the inner four fifths of the joints' ranges, the posture with the largest smallest
    singular value of the tool's Jacobian (m, rad) whose tool points most nearly downwards is turned upright.

    Returns
    -------
    (n_moving,), rad and m, and whether the tool is vertical there
    """
    frames = [mechanism.frames[index] for index in mechanism.moving]
    half = np.array([1.0 if frame.motion == "prismatic" else 2.0 for frame in frames])
    lower = np.maximum([frame.lower for frame in frames], -half)
    upper = np.minimum([frame.upper for frame in frames], half)
    empty = lower >= upper  # a range that does not hold zero
    lower = np.where(empty, [frame.lower for frame in frames], lower)
    upper = np.where(empty, [frame.upper for frame in frames], upper)
    middle, width = (lower + upper) / 2, 0.8 * (upper - lower)
    samples = middle + width * (scipy.stats.qmc.Halton(len(frames), scramble=False).random(tries + 1)[1:] - 0.5)
    turning = [place for place, frame in enumerate(frames) if frame.motion == "revolute"]
    samples[:, turning[:1]] = np.clip(0.0, lower, upper)[turning[:1]]  # turning about the base changes nothing
    tool = mechanism.index(mechanism.tool)
    scores = []
    for q in samples:
        placed = mechanism.transforms(q)[tool]
        smallest = float(np.linalg.svd(tool_jacobian(mechanism, q), compute_uv=False)[-1])
        scores.append(smallest * (1.5 - placed[2, 2]))
    order = np.argsort(scores)[::-1]
    for chosen in order[:8]:
        q = samples[chosen]
        target = mechanism.transforms(q)[tool].copy()
        heading = float(np.arctan2(target[1, 0], target[0, 0]))
        cosine, sine = np.cos(heading), np.sin(heading)
        target[:3, :3] = [[cosine, sine, 0.0], [sine, -cosine, 0.0], [0.0, 0.0, -1.0]]
        try:
            return reach(mechanism, target, q, starts=4), True
        except InputError:
            continue
    return samples[order[0]], False
