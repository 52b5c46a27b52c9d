"""`millfrf new robot`: a robot file from a URDF or a table of Denavit-Hartenberg parameters."""

from pathlib import Path
from typing import Annotated

import typer

from millfrf.core.terminal import say

Triple = tuple[float, float, float]


def new_robot(
    robot: Annotated[Path, typer.Argument(metavar="ROBOT.urdf|DH.csv", help="Kinematics, and masses if any.")],
    out: Annotated[Path, typer.Option("--out", metavar="ROBOT.toml", help="Robot file to write.")],
    dh: Annotated[
        str | None, typer.Option("--dh", metavar="standard|modified", help="Convention of a table in CSV.")
    ] = None,
    tip: Annotated[
        str | None, typer.Option("--flange", metavar="LINK", help="URDF link at the flange; its z points to the tool.")
    ] = None,
    name: Annotated[str | None, typer.Option("--name", help="Name of the robot; default: that of the file.")] = None,
    joint_stiffness: Annotated[
        str | None,
        typer.Option("--joint-stiffness", metavar="K,K,...", help="N m/rad of each joint; N/m of prismatic ones."),
    ] = None,
    stiffness_source: Annotated[
        str | None, typer.Option("--stiffness-source", metavar="TEXT", help="Where the joint stiffness was measured.")
    ] = None,
    rated_payload: Annotated[
        float | None,
        typer.Option("--rated-payload", metavar="KG", help="Rated payload: which range an assumed stiffness is of."),
    ] = None,
    total_mass: Annotated[
        float | None, typer.Option("--total-mass", metavar="KG", help="Moving mass, where the file gives none: spread.")
    ] = None,
    tool: Annotated[
        Triple | None, typer.Option("--tool", metavar="X Y Z", help="Tool tip from the flange, flange axes, m.")
    ] = None,
    tool_turned: Annotated[
        Triple, typer.Option("--tool-turned", metavar="R P Y", help="Tool axes from flange axes, degrees; z: tool.")
    ] = (0.0, 0.0, 0.0),
    spindle_mass: Annotated[
        float | None, typer.Option("--spindle-mass", metavar="KG", help="Spindle, holder and tool together.")
    ] = None,
    spindle_centre: Annotated[
        Triple | None, typer.Option("--spindle-centre", metavar="X Y Z", help="Its centre of mass from the flange, m.")
    ] = None,
    spindle_inertia: Annotated[
        Triple | None, typer.Option("--spindle-inertia", metavar="XX YY ZZ", help="About its centre, kg m^2.")
    ] = None,
    base: Annotated[
        Triple, typer.Option("--base", metavar="X Y Z", help="Robot's base in the cell, whose z points up, m.")
    ] = (0.0, 0.0, 0.0),
    base_turned: Annotated[
        Triple, typer.Option("--base-turned", metavar="R P Y", help="Base axes, degrees; 180 0 0: from a ceiling.")
    ] = (0.0, 0.0, 0.0),
    source: Annotated[
        str | None, typer.Option("--source", metavar="TEXT", help="Where the file comes from, beside its name.")
    ] = None,
    damping: Annotated[
        float | None, typer.Option("--damping", metavar="RATIO", help="Damping ratio of all modes; 0.03 is assumed.")
    ] = None,
) -> None:
    """Write a robot file: joints, bodies with full inertias, tool, spindle; what is assumed is marked."""
    from .robot_file import Asked, write_new_robot

    asked = Asked(
        dh,
        tip,
        name,
        joint_stiffness,
        stiffness_source,
        rated_payload,
        total_mass,
        (tool, tool_turned),
        (spindle_mass, spindle_centre, spindle_inertia),
        (base, base_turned),
        damping,
        source,
    )
    for line in write_new_robot(robot, out, asked):
        say(line)
