"""Masses of the bodies of a robot: assumptions, and plausibility checks of those in a file."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from millfrf.core import InputError, Real
from millfrf.robot_model import BASE, RigidPart, SerialChain

_TAPER = 0.7  # ratio of mass per length of consecutive bodies: robots become lighter towards the flange
_STUB = 0.15  # m; length of a joint in its body


# kg/m^2; moving mass over squared length below which a mass is implausible; cobots have 10 to 20
_LIGHT = 3.0


def with_total_mass(chain: SerialChain, total: float) -> SerialChain:
    """Distribute ``total`` kg over the bodies as cylinders from joint to joint."""
    if chain.parts:
        raise InputError("--total-mass is for files without masses; this one has some: leave it out")
    ends = [joint.place[:3, 3] for joint in chain.joints[1:]] + [chain.flange[:3, 3]]
    lengths = np.array([float(np.linalg.norm(end)) for end in ends]) + _STUB
    shares = lengths * _TAPER ** np.arange(len(ends))
    masses = total * shares / shares.sum()
    parts = [
        RigidPart(f"body {joint.name}", joint.name, float(mass), 0.5 * end, cylinder(float(mass), end, float(length)))
        for joint, end, mass, length in zip(chain.joints, ends, masses, lengths, strict=True)
    ]
    return replace(chain, parts=tuple(parts))


def cylinder(mass: float, along: Sequence[float] | Real, length: float) -> Real:
    """Return the inertia matrix (kg m^2) about the centre of a solid cylinder whose diameter is half its length."""
    radius = length / 4
    axis = np.asarray(along, dtype=float)
    size = float(np.linalg.norm(axis))
    axis = axis / size if size > 1e-9 else np.array([0.0, 0.0, 1.0])
    axial, transverse = mass * radius**2 / 2, mass * (3 * radius**2 + length**2) / 12
    return np.asarray(transverse * np.eye(3) + (axial - transverse) * np.outer(axis, axis))


def mass_doubts(chain: SerialChain) -> list[str]:
    """Return warnings about masses that look like placeholders, as in many files for simulation."""
    moving = [part for part in chain.parts if part.joint != BASE]
    doubts = []
    if len(moving) > 2 and len({round(part.mass, 9) for part in moving}) == 1:
        doubts.append(f"all {len(moving)} bodies have the same mass, {moving[0].mass:g} kg: hardly a robot's")
    span = sum(float(np.linalg.norm(joint.place[:3, 3])) for joint in chain.joints if joint.motion == "revolute")
    total = sum(part.mass for part in moving)
    if moving and total < _LIGHT * span**2:
        doubts.append(
            f"the moving bodies weigh {total:.3g} kg over a length of {span:.2g} m, much less than "
            "robots of that size: look at the masses before you trust a frequency"
        )
    for part in moving:
        gyration = float(np.sqrt(np.linalg.eigvalsh(part.inertia)[-1] / part.mass))
        if gyration > max(span, 0.1) or (part.mass > 0.5 and gyration < 1e-3):
            doubts.append(
                f"body {part.name}: inertia and mass give a radius of gyration of {1e3 * gyration:.3g} mm, which does "
                "not fit its size: look at its inertia"
            )
    return doubts


def doubted_sources(chain: SerialChain, doubts: Sequence[str], origin: str) -> dict[str, str]:
    """Return the sources of bodies with implausible masses, marked as assumptions, so that every result lists them.

    A warning that starts with ``body NAME:`` is about this body; any other warning is about all bodies.
    """
    sources = {}
    for part in chain.parts:
        of_part = [doubt for doubt in doubts if doubt.startswith(f"body {part.name}:") or not doubt.startswith("body ")]
        if of_part and part.joint != BASE:
            sources[part.name] = f"{origin}; assumed to be right, though doubted: {of_part[0]}"
    return sources
