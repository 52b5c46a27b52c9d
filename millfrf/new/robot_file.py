"""Step ``new robot``: a robot file from a URDF or a table of Denavit-Hartenberg parameters, with masses."""

from collections.abc import Sequence
from dataclasses import replace
from math import radians
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt, Le, Lt

from millfrf.core import InputError, MillfrfError, Real
from millfrf.core.provenance import sha256
from millfrf.core.steps import File, Reads, Typed, Writes, step
from millfrf.core.terminal import say, say_written, warn
from millfrf.robot_model import (
    BASE,
    TYPICAL,
    ReadChain,
    RigidPart,
    SerialChain,
    SerialFileData,
    chain_text,
    flange_doubts,
    in_posture,
    mass_doubts,
    moving_mass,
    place_of,
    read_dh,
    read_robot,
    read_urdf,
    ready_posture,
    spatial_robot,
    typed_values,
    typical_stiffness,
)

from .templates import write_new

Triple = tuple[float, float, float]
Place = Annotated[Triple, Typed("X Y Z"), Ge(-20), Le(20)]
Turned = Annotated[Triple, Typed("R P Y"), Ge(-360), Le(360)]

_DAMPING = 0.03  # assumed damping ratio; measured values of milling robots are 1 to 10 %

# N m/rad and N/m; plausible joint stiffness, wider than all assumed ranges; outside, the unit may be wrong
_USUAL = {"revolute": (1e3, 1e8), "prismatic": (1e5, 1e10)}


@step
def new_robot(
    kinematics: Annotated[File, Reads("ROBOT.urdf|DH.csv")],
    /,
    *,
    out: Annotated[File | None, Writes(suffixes=(".toml",), needed=True)] = None,
    dh: Literal["standard", "modified"] | None = None,
    flange: Annotated[str, Typed("LINK")] | None = None,
    name: str | None = None,
    joint_stiffness: Annotated[str | Sequence[float] | None, Typed("K,K,...", str)] = None,
    stiffness_source: str | None = None,
    rated_payload: Annotated[float | None, Typed("KG"), Gt(0)] = None,
    total_mass: Annotated[float | None, Typed("KG"), Gt(0), Le(20_000)] = None,
    tool: Place | None = None,
    tool_turned: Turned = (0.0, 0.0, 0.0),
    spindle_mass: Annotated[float | None, Typed("KG"), Gt(0), Le(2000)] = None,
    spindle_centre: Annotated[Triple | None, Typed("X Y Z"), Ge(-5), Le(5)] = None,
    spindle_inertia: Annotated[Triple | None, Typed("XX YY ZZ")] = None,
    base: Place = (0.0, 0.0, 0.0),
    base_turned: Turned = (0.0, 0.0, 0.0),
    source: str | None = None,
    damping: Annotated[float | None, Typed("RATIO"), Ge(0), Lt(1)] = None,
) -> str:
    """Write a robot file: joints, bodies with full inertias, tool, spindle; assumptions are marked.

    Parameters
    ----------
    kinematics
        URDF, or table (.csv) of Denavit-Hartenberg parameters; masses are optional.
    out
        Robot file to write.
    dh
        Convention of a table of Denavit-Hartenberg parameters; modified: Craig, Khalil.
    flange
        Link of a URDF at the flange, whose z points to the tool.
    name
        Name of the robot; without it the name of the file.
    joint_stiffness : N m/rad
        Stiffness of each joint; prismatic joints in N/m. Without it typical values are assumed.
    stiffness_source
        Where the joint stiffness was measured.
    rated_payload : kg
        Rated payload, which determines typical joint stiffnesses.
    total_mass : kg
        Moving mass of a robot whose file has no masses; it is distributed over the bodies.
    tool : m
        Tool tip from the flange, in the axes of the flange; without it the flange.
    tool_turned : deg
        Roll, pitch and yaw of the tool's axes from those of the flange; z points along the tool.
    spindle_mass : kg
        Mass of spindle, holder and tool together.
    spindle_centre : m
        Their centre of mass from the flange; without it half-way to the tip.
    spindle_inertia : kg m^2
        Their moments of inertia about that centre; without it those of a cylinder.
    base : m
        Position of the base of the robot in the cell, whose z points up.
    base_turned : deg
        Roll, pitch and yaw of the base's axes; 180 0 0: from a ceiling.
    source
        Origin of the file, in addition to its name.
    damping
        Damping ratio of all modes; without it 0.03 is assumed.

    Returns
    -------
    str
        Text of the robot file.

    Raises
    ------
    InputError
        The file is no serial robot, or an option does not fit it.

    Examples
    --------
    ::

        $ millfrf new robot robot.urdf --flange flange --out robot.toml
    """
    path = Path(kinematics)
    read = _read(path, dh, flange)
    chain = with_total_mass(read.chain, total_mass) if total_mass is not None else read.chain
    chain = replace(
        chain,
        base=_place(base, base_turned) @ chain.base,
        tool=_place(tool or (0.0, 0.0, 0.0), tool_turned),
    )
    bodies, doubts = _body_sources(path, chain, total_mass, rated_payload)
    doubts = [*(note for note in read.notes if total_mass is None or "no masses" not in note), *doubts]
    stiffness, doubt = _stiffness(chain, joint_stiffness, stiffness_source, rated_payload)
    spindle, no_spindle = _spindle(spindle_mass, spindle_centre, spindle_inertia, tool)
    doubts += [*doubt, *no_spindle, *flange_doubts(chain, turned=any(tool_turned))]
    tool_source = "given on the command line"
    if tool is None:
        tool_source = "assumed: no --tool was given, the tip is at the flange"
        doubts.append("no --tool X Y Z was given: the tool's tip is taken at the flange")
    damping_ratio = (_DAMPING, "assumed: 1 to 10 % are measured on milling robots; measure it")
    if damping is not None:
        damping_ratio = (damping, "given on the command line")
    statements = SerialFileData(
        stiffness,
        spindle,
        damping_ratio,
        f"{path.name} (SHA-256 {sha256(path)[:16]})" + (f"; {source}" if source else ""),
        path.name,
        tool_source,
        "base of the robot in the cell, whose z points up",
        _first_posture(chain),
        bodies,
        tuple(doubts),
    )
    text = chain_text(name or path.stem, chain, statements)
    frequencies = _checked(text, path, out)
    if out is not None:
        write_new(Path(out), text)
    warn(doubts)
    say(frequencies)
    say_written([out], f"{len(chain.joints)} joints, {_masses(chain)}")
    return text


def _read(path: Path, dh: str | None, flange: str | None) -> ReadChain:
    if path.suffix.lower() == ".csv":
        if dh is None:
            raise InputError(f"{path}: say what the table means: --dh standard, or --dh modified (Craig, Khalil)")
        if flange is not None:
            raise InputError("--flange names a link of a URDF; a table ends at its last frame: use --tool")
        return read_dh(path, dh)
    if path.suffix.lower() not in (".urdf", ".xml"):
        raise InputError(f"{path}: give a .urdf, or a .csv of Denavit-Hartenberg parameters")
    if dh is not None:
        raise InputError("--dh says what a table in CSV means; a URDF needs none")
    return read_urdf(path, flange)


def _place(shift: Triple, turned: Triple) -> Real:
    return place_of(shift, [radians(angle) for angle in turned])


def _body_sources(
    path: Path, chain: SerialChain, total_mass: float | None, payload: float | None
) -> tuple[dict[str, str], list[str]]:
    """Return the sources of bodies with assumed or implausible masses, and warnings."""
    doubts = mass_doubts(chain, payload)
    if total_mass is not None:
        return {part.name: f"assumed: {total_mass:g} kg spread over the bodies" for part in chain.parts}, doubts
    return doubted_sources(chain, doubts, path.name) if doubts else {}, doubts


def _first_posture(chain: SerialChain) -> tuple[list[float], str]:
    """Return the joint values of a well-conditioned posture, and their source."""
    mechanism = spatial_robot(chain).mechanism
    q, upright = ready_posture(mechanism)
    values = np.round(typed_values(mechanism, q), 6)
    return [float(value) for value in values], "chosen: well-conditioned" + (", tool vertical" if upright else "")


def _stiffness(
    chain: SerialChain, values_given: str | Sequence[float] | None, source: str | None, payload: float | None
) -> tuple[list[tuple[float, str]], list[str]]:
    """Return the stiffness of each joint with its source (given, or the middle of a typical range), and warnings."""
    if values_given is not None:
        values = _given_stiffness(chain, values_given)
        stated_source = source or "given on the command line; say here how it was measured"
        return [(value, stated_source) for value in values], _stiffness_doubts(chain, values)
    reason = "rated payload given"
    if payload is None:
        mass = moving_mass(chain)
        if not mass:
            raise InputError(
                "joint stiffness is not known, and without masses no range can be chosen; give --joint-stiffness "
                "K,K,... (N m/rad), or --rated-payload KG to assume typical ones"
            )
        payload = mass / TYPICAL.mass_to_payload
        reason = f"rated payload taken as 1/{TYPICAL.mass_to_payload:g} of the moving mass of {mass:.0f} kg"
    assumed = "assumed: within {0:.1e} to {1:.1e}, proportional to the torque of the payload at the reach, "
    stiffness = [
        (float(f"{middle:.6g}"), assumed.format(*span) + f"{reason}; measure it")
        for middle, span in typical_stiffness(chain, payload)
    ]
    return stiffness, [
        f"joint stiffness is not known and was assumed ({reason}; right within a factor of "
        f"{TYPICAL.stiffness_factor:g}): every result will say so until --joint-stiffness or measured values replace it"
    ]


def _given_stiffness(chain: SerialChain, text_or_values: str | Sequence[float]) -> list[float]:
    try:
        values = [
            float(value) for value in (text_or_values.split(",") if isinstance(text_or_values, str) else text_or_values)
        ]
    except ValueError as error:
        raise InputError(f"--joint-stiffness {text_or_values!r}: give numbers such as 1e6,4e6,3e6") from error
    if len(values) != len(chain.joints):
        names = ", ".join(f"{j.name} ({'N/m' if j.motion == 'prismatic' else 'N m/rad'})" for j in chain.joints)
        raise InputError(f"--joint-stiffness gives {len(values)} numbers for {len(chain.joints)} joints: {names}")
    for value in values:
        if not 1.0 <= value <= 1e12:
            raise InputError(f"--joint-stiffness {value:g}: give N m/rad (N/m of prismatic joints), 1 to 1e12")
    return values


def _stiffness_doubts(chain: SerialChain, values: list[float]) -> list[str]:
    """Return a warning about implausible stiffnesses, as from a wrong unit."""
    implausible = [
        f"{joint.name} {value:g}"
        for joint, value in zip(chain.joints, values, strict=True)
        if not _USUAL[joint.motion][0] <= value <= _USUAL[joint.motion][1]
    ]
    if not implausible:
        return []
    return [
        f"--joint-stiffness: {', '.join(implausible)} is far from what robots have (1e3 to 1e8 N m/rad; 1e5 to "
        "1e10 N/m): is the unit right? kN m/rad times 1000, N m/arcmin times 3438, N/um times 1e6"
    ]


def _spindle(
    mass: float | None, centre: Triple | None, inertia: Triple | None, tool: Triple | None
) -> tuple[tuple[float, Real, Real, str] | None, list[str]]:
    """Return mass, centre (m), inertia (kg m^2) and source of the spindle; None and a warning without a mass."""
    if mass is None:
        if centre is not None or inertia is not None:
            raise InputError("--spindle-centre and --spindle-inertia need --spindle-mass KG")
        return None, ["no --spindle-mass KG was given: the robot carries no spindle"]
    tip = tool or (0.0, 0.0, 0.3)
    place = np.array(centre if centre is not None else [value / 2 for value in tip])
    if inertia is not None:
        assumed = "" if centre is not None else "assumed: centre half-way to the tip; "
        return (mass, place, np.diag(inertia), assumed + "mass and inertia given on the command line"), []
    length = max(float(np.linalg.norm(tip)), 0.1)
    source = "mass given; assumed: inertia of a solid cylinder half as thick as long"
    source += "" if centre is not None else ", centre half-way to the tip"
    return (mass, place, cylinder(mass, tip, length), source), []


def _checked(text: str, path: Path, out: File | None) -> str:
    """Check a robot file before it is written; return a sentence on its natural frequencies."""
    with TemporaryDirectory() as folder:
        draft = Path(folder) / "robot.toml"
        draft.write_text(text, encoding="utf-8")
        try:
            return _frequencies(draft)
        except MillfrfError as error:
            raise InputError(str(error).replace(f"{draft}: ", f"{path}, as {out} would have it: ")) from error


def _frequencies(path: Path) -> str:
    """Return a sentence on the natural frequencies in the first posture."""
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
        return "no masses: stiffness and deflection can be computed, modes and lobes cannot"
    shown = ", ".join(f"{frequency:.2f}" for frequency in result.frequencies[:3])
    return f"natural frequencies in the posture 'ready': {shown} ... Hz"


def _masses(chain: SerialChain) -> str:
    moving = [part for part in chain.parts if part.joint != BASE]
    return f"{len(moving)} moving bodies with {moving_mass(chain):.4g} kg"


_TAPER = 0.7  # ratio of mass per length of consecutive bodies: robots become lighter towards the flange
_STUB = 0.15  # m; length of a joint in its body


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
