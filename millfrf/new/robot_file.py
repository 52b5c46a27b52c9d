"""A robot file from a URDF or a DH table; assumed masses."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import radians
from pathlib import Path

import numpy as np

from millfrf.core import InputError, MillfrfError, Real, writing_whole_file
from millfrf.core.provenance import sha256
from millfrf.options import check_output
from millfrf.robot_model import (
    BASE,
    ReadChain,
    RigidPart,
    SerialChain,
    Told,
    chain_text,
    class_of,
    in_posture,
    place_of,
    read_dh,
    read_robot,
    read_urdf,
    ready_posture,
    spatial_robot,
    typed_values,
    typical,
)

_TAPER = 0.7
"""Mass per length of each body from that before it: robots grow lighter outwards."""

_STUB = 0.15
"""Length that a joint itself adds to its body, m."""


_LIGHT = 3.0
"""Moving mass over squared length below which a robot is hardly one that mills, kg/m^2; cobots have 10 to 20."""


def with_total_mass(chain: SerialChain, total: float) -> SerialChain:
    """The chain with ``total`` kg spread over its bodies as slender cylinders from joint to joint.

    Raises
    ------
    InputError
        A mass that is not positive, or bodies that have masses already.
    """
    if not 0 < total <= 2e4:
        raise InputError(f"--total-mass {total:g}: give the mass of the moving bodies in kg")
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
    """Inertia (3, 3) about the centre of a solid cylinder half as thick as long, its axis along a vector; kg m^2."""
    radius = length / 4
    axis = np.asarray(along, dtype=float)
    size = float(np.linalg.norm(axis))
    axis = axis / size if size > 1e-9 else np.array([0.0, 0.0, 1.0])
    own, across = mass * radius**2 / 2, mass * (3 * radius**2 + length**2) / 12
    return np.asarray(across * np.eye(3) + (own - across) * np.outer(axis, axis))


def mass_doubts(chain: SerialChain) -> list[str]:
    """Sentences on masses that look like placeholders: files for simulation often carry such numbers."""
    moving = [part for part in chain.parts if part.joint != BASE]
    found = []
    if len(moving) > 2 and len({round(part.mass, 9) for part in moving}) == 1:
        found.append(f"all {len(moving)} bodies have the same mass, {moving[0].mass:g} kg: hardly a robot's")
    span = sum(float(np.linalg.norm(joint.place[:3, 3])) for joint in chain.joints if joint.motion == "revolute")
    total = sum(part.mass for part in moving)
    if moving and total < _LIGHT * span**2:
        found.append(
            f"the moving bodies weigh {total:.3g} kg over a length of {span:.2g} m, much less than "
            "robots of that size: look at the masses before you trust a frequency"
        )
    for part in moving:
        gyration = float(np.sqrt(np.linalg.eigvalsh(part.inertia)[-1] / part.mass))
        if gyration > max(span, 0.1) or (part.mass > 0.5 and gyration < 1e-3):
            found.append(
                f"body {part.name}: inertia and mass give a radius of gyration of {1e3 * gyration:.3g} mm, which does "
                "not fit its size: look at its inertia"
            )
    return found


def doubted_sources(chain: SerialChain, doubts: Sequence[str], origin: str) -> dict[str, str]:
    """Sources of moving bodies whose masses are doubted, marked as assumed so that every result names them.

    A doubt that begins with ``body NAME:`` is of that body, any other of all of them.
    """
    found = {}
    for part in chain.parts:
        own = [doubt for doubt in doubts if doubt.startswith(f"body {part.name}:") or not doubt.startswith("body ")]
        if own and part.joint != BASE:
            found[part.name] = f"{origin}; assumed to be right, though doubted: {own[0]}"
    return found


Triple = tuple[float, float, float]

_DAMPING = 0.03
"""Assumed damping ratio: between the 1 and 10 % that are measured on milling robots."""

_USUAL = {"revolute": (1e3, 1e8), "prismatic": (1e5, 1e10)}
"""Joint stiffness outside of which a unit is doubted, N m/rad and N/m: wide of every range that is assumed."""

_MASS_TO_PAYLOAD = 5.0
"""Moving mass over rated payload of industrial robots, roughly."""


@dataclass(frozen=True)
class Asked:
    """Options of `millfrf new robot` as they were typed; None where left out."""

    dh: str | None
    tip: str | None
    name: str | None
    joint_stiffness: str | None
    stiffness_source: str | None
    rated_payload: float | None
    total_mass: float | None
    tool: tuple[Triple | None, Triple]
    spindle: tuple[float | None, Triple | None, Triple | None]
    base: tuple[Triple, Triple]
    damping: float | None
    source: str | None = None


def write_new_robot(path: Path, out: Path, asked: Asked) -> list[str]:
    """Write the robot file, read it back, and compute its first posture; lines that say what came of it.

    Raises
    ------
    InputError
        A file that is no serial robot, or options that do not fit it.
    """
    check_output(out, (".toml",), [path])
    read = _read(path, asked)
    chain = with_total_mass(read.chain, asked.total_mass) if asked.total_mass is not None else read.chain
    offset, turned = asked.tool
    chain = replace(
        chain,
        base=_typed_place("base", *asked.base) @ chain.base,
        tool=_typed_place("tool", offset or (0.0, 0.0, 0.0), turned),
    )
    told, doubts = _told(path, read, chain, asked)
    with writing_whole_file(out) as unfinished:
        unfinished.write_text(chain_text(asked.name or path.stem, chain, told), encoding="utf-8")
        named = unfinished.with_suffix(".toml")  # a robot file is known by its suffix
        unfinished.rename(named)
        try:
            summary = _checked(named)
        except MillfrfError as error:  # the unfinished file goes: a reader knows the one that he gave
            said = str(error).replace(f"{named}: ", f"{path}, as {out} would have it: ")
            raise InputError(said) from error
        finally:
            named.rename(unfinished)
    return [
        *(f"warning: {doubt}" for doubt in doubts),
        *summary,
        f"wrote {out}: {len(chain.joints)} joints, {_masses(chain)}",
    ]


def _read(path: Path, asked: Asked) -> ReadChain:
    if path.suffix.lower() == ".csv":
        if asked.dh is None:
            raise InputError(f"{path}: say what the table means: --dh standard, or --dh modified (Craig, Khalil)")
        if asked.tip is not None:
            raise InputError("--flange names a link of a URDF; a table ends at its last frame: use --tool")
        return read_dh(path, asked.dh)
    if path.suffix.lower() not in (".urdf", ".xml"):
        raise InputError(f"{path}: give a .urdf, or a .csv of Denavit-Hartenberg parameters")
    if asked.dh is not None:
        raise InputError("--dh says what a table in CSV means; a URDF needs none")
    return read_urdf(path, asked.tip)


def _typed_place(option: str, shift: Triple, turned: Triple) -> Real:
    if not np.all(np.isfinite([*shift, *turned])) or max(map(abs, shift)) > 20 or max(map(abs, turned)) > 360:
        raise InputError(f"--{option} {shift}, turned {turned}: give metres, at most 20, and degrees, at most 360")
    return place_of(shift, [radians(angle) for angle in turned])


def _told(path: Path, read: ReadChain, chain: SerialChain, asked: Asked) -> tuple[Told, list[str]]:
    """Sources of all numbers, and what should be said of them."""
    origin = f"{path.name} (SHA-256 {sha256(path)[:16]})" + (f"; {asked.source}" if asked.source else "")
    notes = [note for note in read.notes if asked.total_mass is None or "no masses" not in note]
    of_masses = mass_doubts(chain)
    doubts = [*notes, *of_masses]
    stiffness, doubt = _stiffness(chain, asked)
    doubts += [doubt] if doubt else []
    spindle, said = _spindle(asked)
    doubts += said
    q, upright = ready_posture(spatial_robot(chain).mechanism)
    posture = np.round(typed_values(spatial_robot(chain).mechanism, q), 6)
    bodies = {}
    if asked.total_mass is not None:
        bodies = {part.name: f"assumed: {asked.total_mass:g} kg spread over the bodies" for part in chain.parts}
    elif of_masses:
        bodies = doubted_sources(chain, of_masses, path.name)
    tool = "given on the command line"
    if asked.tool[0] is None:
        tool = "assumed: no --tool was given, the tip is at the flange"
        doubts.append("no --tool X Y Z was given: the tool's tip is taken at the flange")
    damping = (asked.damping, "given on the command line")
    if asked.damping is None:
        damping = (_DAMPING, "assumed: 1 to 10 % are measured on milling robots; measure it")
    elif not 0 <= asked.damping < 1:
        raise InputError(f"--damping {asked.damping:g}: give a ratio of 0 or more and below 1; 3 % is 0.03")
    found = Told(
        stiffness,
        spindle,
        (float(damping[0] or 0.0), damping[1]),
        origin,
        path.name,
        tool,
        "base of the robot in the cell, whose z points up",
        ([float(value) for value in posture], "chosen: well-conditioned" + (", tool vertical" if upright else "")),
        bodies,
        tuple(doubts),
    )
    return found, doubts


def _stiffness(chain: SerialChain, asked: Asked) -> tuple[list[tuple[float, str]], str | None]:
    """Given numbers, or the middle of a range, marked as assumed."""
    joints = chain.joints
    if asked.joint_stiffness is not None:
        try:
            values = [float(text) for text in asked.joint_stiffness.split(",")]
        except ValueError as error:
            raise InputError(
                f"--joint-stiffness {asked.joint_stiffness!r}: give numbers such as 1e6,4e6,3e6"
            ) from error
        if len(values) != len(joints):
            names = ", ".join(f"{j.name} ({'N/m' if j.motion == 'prismatic' else 'N m/rad'})" for j in joints)
            raise InputError(f"--joint-stiffness gives {len(values)} numbers for {len(joints)} joints: {names}")
        for value in values:
            if not 1.0 <= value <= 1e12:
                raise InputError(f"--joint-stiffness {value:g}: give N m/rad (N/m of prismatic joints), 1 to 1e12")
        doubt = _stiffness_doubt(chain, values)
        source = asked.stiffness_source or "given on the command line; say here how it was measured"
        return [(value, source) for value in values], doubt
    payload, why = asked.rated_payload, "rated payload given"
    if payload is None:
        mass = sum(part.mass for part in chain.parts if part.joint != "base")
        if not mass:
            raise InputError(
                "joint stiffness is not known, and without masses no range can be chosen; give --joint-stiffness "
                "K,K,... (N m/rad), or --rated-payload KG to assume typical ones"
            )
        payload = mass / _MASS_TO_PAYLOAD
        why = f"rated payload taken as a fifth of the moving mass of {mass:.0f} kg"
    entry = class_of(payload)
    found = [
        (float(f"{middle:.2g}"), f"assumed: middle of {span[0]:.0e} to {span[1]:.0e}, {why}; {entry.basis}; measure it")
        for middle, span in typical(joints, entry)
    ]
    return found, (
        f"joint stiffness is not known and was assumed ({why}, {_class_words(entry.payload)}): every result will "
        "say so until --joint-stiffness or measured values replace it"
    )


def _stiffness_doubt(chain: SerialChain, values: list[float]) -> str | None:
    """A sentence on joint stiffnesses that no robot has, which a slip of the unit makes."""
    odd = [
        f"{joint.name} {value:g}"
        for joint, value in zip(chain.joints, values, strict=True)
        if not _USUAL[joint.motion][0] <= value <= _USUAL[joint.motion][1]
    ]
    if not odd:
        return None
    return (
        f"--joint-stiffness: {', '.join(odd)} is far from what robots have (1e3 to 1e8 N m/rad; 1e5 to 1e10 N/m): "
        "is the unit right? kN m/rad times 1000, N m/arcmin times 3438, N/um times 1e6"
    )


def _class_words(payload: float) -> str:
    return f"class up to {payload:g} kg" if np.isfinite(payload) else "class of the heaviest robots"


def _spindle(asked: Asked) -> tuple[tuple[float, Real, Real, str] | None, list[str]]:
    mass, centre, inertia = asked.spindle
    if mass is None:
        if centre is not None or inertia is not None:
            raise InputError("--spindle-centre and --spindle-inertia need --spindle-mass KG")
        return None, ["no --spindle-mass KG was given: the robot carries no spindle"]
    if not 0 < mass <= 2000:
        raise InputError(f"--spindle-mass {mass:g}: give kilograms, above 0 and at most 2000")
    tip = asked.tool[0] or (0.0, 0.0, 0.3)
    place = np.array(centre if centre is not None else [value / 2 for value in tip])
    if np.abs(place).max() > 5:
        raise InputError(f"--spindle-centre {centre}: give metres from the flange, at most 5")
    if inertia is not None:
        assumed = "" if centre is not None else "assumed: centre half-way to the tip; "
        return (mass, place, np.diag(inertia), assumed + "mass and inertia given on the command line"), []
    length = max(float(np.linalg.norm(tip)), 0.1)
    source = "mass given; assumed: inertia of a solid cylinder half as thick as long"
    source += "" if centre is not None else ", centre half-way to the tip"
    return (mass, place, cylinder(mass, tip, length), source), []


def _checked(path: Path) -> list[str]:
    """What the program makes of the file, in its first posture."""
    case = read_robot(path)
    driven = next(iter(case.poses.values()))
    try:
        result = in_posture(case, driven)
    except InputError as error:
        if "singular" not in str(error):
            raise
        raise InputError(
            "the bodies behind the last joints have no mass, or no inertia about their axis; give --spindle-mass KG, "
            "which is what the robot carries when it mills"
        ) from error
    if not len(result.frequencies):
        return ["no masses: stiffness and deflection can be computed, modes and lobes cannot"]
    shown = ", ".join(f"{frequency:.2f}" for frequency in result.frequencies[:3])
    return [f"natural frequencies in the posture 'ready': {shown} ... Hz"]


def _masses(chain: SerialChain) -> str:
    moving = [part for part in chain.parts if part.joint != "base"]
    return f"{len(moving)} moving bodies with {sum(part.mass for part in moving):.4g} kg"
