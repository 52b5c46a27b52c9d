"""What industrial robots have in common: joint stiffness and mass; and doubts about a chain that differs."""

import numpy as np
import scipy

from millfrf.core import InputError

from ..settings import TYPICAL
from .serial_chain import BASE, SerialChain, shift_and_angles, turn_onto


def reach_of(chain: SerialChain) -> float:
    """Return the reach (m) as in data sheets: largest distance of the last joint from the first axis.

    It is the largest of a Halton sequence of postures within the joint limits, which is up to a few per cent too short.
    """
    joints = chain.joints
    first = next((number for number, joint in enumerate(joints) if joint.motion == "revolute"), 0)
    samples = scipy.stats.qmc.Halton(len(joints), scramble=False).random(TYPICAL.reach_postures)
    places = np.zeros((len(samples), 3))
    for number in range(len(joints) - 1, first, -1):  # of the last joint, in the axes of the body before each joint
        joint, share = joints[number], samples[:, number]
        axis = np.asarray(joint.axis, dtype=float) / np.linalg.norm(joint.axis)
        if joint.motion == "revolute":
            lower, upper = max(joint.lower, -np.pi), min(joint.upper, np.pi)
            turns = (lower + share * (upper - lower))[:, None] * axis
            places = scipy.spatial.transform.Rotation.from_rotvec(turns).apply(places)
        places = places @ joint.place[:3, :3].T + joint.place[:3, 3]
    axis = np.asarray(joints[first].axis, dtype=float) / np.linalg.norm(joints[first].axis)
    return float(np.linalg.norm(np.cross(places, axis), axis=1).max())


def typical_stiffness(chain: SerialChain, payload: float) -> list[tuple[float, tuple[float, float]]]:
    r"""Return typical stiffness and range of each joint, N m/rad; N/m for prismatic joints.

    Gears are chosen by torque, and the angle by which they twist under their rated torque is nearly the same in all
    sizes (cycloidal gears of 58 to 4410 N m: 0.8 to 1.2 mrad in makers' catalogues). Stiffness is therefore
    proportional to the torque of the rated payload :math:`m` at the reach :math:`r`:

    .. math:: k = c \, m g r

    with one factor :math:`c` for the first three revolute joints and another for the others. A robot whose masses are
    all multiplied by a number, and its payload with them, keeps its natural frequencies.

    Parameters
    ----------
    chain
        Joints of the robot.
    payload : kg
        Rated payload, which stands for the torque of the gears.

    Raises
    ------
    InputError
        A payload that is not positive.

    References
    ----------
    The factors are choices of this project, of the order that was identified on heavy KUKA robots: Dumas et al., Joint
    stiffness identification of six-revolute industrial serial robots, Robotics and Computer-Integrated Manufacturing 27
    (2011): KR 240-2. Klimchik et al., Identification of geometrical and elastostatic parameters of heavy industrial
    robots, ICRA 2013: KR 270. Jubien, Abba & Gautier, Joint stiffness identification of a heavy Kuka robot with a
    low-cost clamped end-effector procedure, ICINCO 2014: KR 500.
    """
    if not payload > 0:
        raise InputError(f"--rated-payload {payload:g}: give the robot's rated payload in kg")
    torque = payload * scipy.constants.g * max(reach_of(chain), TYPICAL.least_reach)
    values, turning = [], 0
    for joint in chain.joints:
        middle = TYPICAL.rail_stiffness
        if joint.motion == "revolute":
            middle = torque * (TYPICAL.arm_stiffness if turning < 3 else TYPICAL.wrist_stiffness)
            turning += 1
        values.append((middle, (middle / TYPICAL.stiffness_factor, middle * TYPICAL.stiffness_factor)))
    return values


def moving_mass(chain: SerialChain) -> float:
    """Return the mass (kg) of all bodies but those on the base."""
    return sum(part.mass for part in chain.parts if part.joint != BASE)


def mass_doubts(chain: SerialChain, payload: float | None = None) -> list[str]:
    """Return warnings about implausible masses: placeholders, wrong units, bodies in the wrong order."""
    moving = [part for part in chain.parts if part.joint != BASE]
    doubts = []
    if len(moving) > 2 and len({round(part.mass, 9) for part in moving}) == 1:
        doubts.append(f"all {len(moving)} bodies have the same mass, {moving[0].mass:g} kg: hardly a robot's")
    span = sum(float(np.linalg.norm(joint.place[:3, 3])) for joint in chain.joints if joint.motion == "revolute")
    total = moving_mass(chain)
    if moving and total < TYPICAL.light * span**2:
        doubts.append(
            f"the moving bodies weigh {total:.3g} kg over a length of {span:.2g} m, much less than "
            "robots of that size: look at the masses before you trust a frequency"
        )
    doubts += [*_weight_doubts(chain, payload), *_order_doubts(chain)]
    for part in moving:
        gyration = float(np.sqrt(np.linalg.eigvalsh(part.inertia)[-1] / part.mass))
        if gyration > max(span, 0.1) or (part.mass > 0.5 and gyration < 1e-3):
            doubts.append(
                f"body {part.name}: inertia and mass give a radius of gyration of {1e3 * gyration:.3g} mm, which does "
                "not fit its size: look at its inertia"
            )
    return doubts


def _weight_doubts(chain: SerialChain, payload: float | None) -> list[str]:
    """Return a warning if the bodies weigh more than nearly all robots of that reach and payload."""
    turning = {joint.name for joint in chain.joints if joint.motion == "revolute"} | {BASE}
    reach, total = reach_of(chain), sum(part.mass for part in chain.parts if part.joint in turning)
    if not (reach and total):
        return []
    sizes, (scatter, freedom) = [1.0, float(np.log(reach))], TYPICAL.mass_over_reach_residual
    law: tuple[float, ...] = TYPICAL.mass_over_reach
    if payload is not None:
        law, (scatter, freedom) = TYPICAL.mass_over_payload, TYPICAL.mass_over_payload_residual
        sizes.append(float(np.log(payload)))
    typical = float(np.exp(np.dot(law, sizes)))
    bound = typical * float(np.exp(scatter * scipy.stats.t.ppf(TYPICAL.mass_level, freedom)))
    if total <= bound:
        return []
    carried = f" and {payload:g} kg of payload" if payload is not None else ""
    return [
        f"the bodies weigh {total:.4g} kg, robots of {reach:.2g} m reach{carried} about {typical:.0f} kg and "
        f"{TYPICAL.mass_level:.0%} of them less than {bound:.0f} kg: look at the masses before you trust a frequency"
    ]


def _order_doubts(chain: SerialChain) -> list[str]:
    """Return warnings about wrist bodies heavier than each body before them: the joints before must carry them."""
    turning = [joint.name for joint in chain.joints if joint.motion == "revolute"]
    masses = [sum(part.mass for part in chain.parts if part.joint == name) for name in turning]
    doubts = []
    for number in range(3, len(masses)):
        if masses[number] > max(masses[:number]) > 0:
            heaviest = max((part for part in chain.parts if part.joint == turning[number]), key=lambda part: part.mass)
            doubts.append(
                f"body {heaviest.name}: with {masses[number]:.3g} kg behind joint {turning[number]} it outweighs each "
                f"body before it ({', '.join(f'{mass:.3g}' for mass in masses[:number])} kg), though robots become "
                "lighter towards the flange: look at its mass"
            )
    return doubts


def flange_doubts(chain: SerialChain, *, turned: bool) -> list[str]:
    """Return a warning if the tool's axis stands across the last revolute joint, and nobody turned it."""
    last = chain.joints[-1]
    axis = np.asarray(last.axis, dtype=float) / np.linalg.norm(last.axis)
    across = min(float(np.linalg.norm(np.cross(chain.flange[:3, 2], axis))), 1.0)
    if turned or last.motion != "revolute" or across < TYPICAL.axis_error:
        return []
    outward = chain.flange[:3, 3] @ axis  # from the last joint to the flange
    turn = np.eye(4)
    turn[:3, :3] = chain.flange[:3, :3].T @ turn_onto(axis if outward >= 0 else -axis)[:3, :3]
    angles = np.round(np.degrees(shift_and_angles(turn)[1]), 6) + 0.0  # no -0
    return [
        f"the z axis of the flange, along which the tool points, stands at {np.degrees(np.arcsin(across)):.0f} "
        f"deg to the axis of the last joint, {last.name}: choose another --flange LINK, or turn the tool with "
        f"--tool-turned {' '.join(f'{angle:.6g}' for angle in angles)}"
    ]
