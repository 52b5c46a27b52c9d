"""The text of a robot file of kind ``serial``: what is known, what is assumed, and what to measure."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .rigid_places import shift_and_angles, six_of
from .serial_chain import SerialChain, SerialJoint
from .stiffness_ranges import CLASSES, RAIL_STIFFNESS

Real = NDArray[np.float64]


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
