"""`millfrf robot path`: postures along a tool path, for depth, deviation or both."""

from pathlib import Path
from typing import Annotated

import typer

from .options import Joints, PayloadAt, PayloadMass, Pose, Robot, Weight


def path_command(
    robot: Robot,
    path: Annotated[
        Path, typer.Argument(metavar="PATH.csv", help="x_m y_m z_m, and i j k (tool axis) or rx_rad ry_rad rz_rad.")
    ],
    cutting: Annotated[Path, typer.Option("--cutting", metavar="CUT.toml", help="Cutter, engagement, coefficients.")],
    speed: Annotated[float, typer.Option("--speed", metavar="RPM", help="Spindle speed.")],
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR|FILE.csv", help="Folder for all results, or the table alone.")
    ],
    optimise: Annotated[str, typer.Option("--optimise", help="depth, deviation or both.")] = "depth",
    depth: Annotated[
        float | None,
        typer.Option("--depth", metavar="M", help="Planned depth of cut: its mean force bends the robot."),
    ] = None,
    max_depth: Annotated[float, typer.Option("--max-depth", metavar="M", help="Largest depth looked at, m.")] = 0.02,
    turns: Annotated[
        tuple[float, float, int], typer.Option("--turns", metavar="LO HI N", help="About the tool's axis, degrees.")
    ] = (-180.0, 165.0, 24),
    table: Annotated[
        tuple[float, float, int] | None,
        typer.Option("--table-turns", metavar="LO HI N", help="Rotary table that carries the work, degrees."),
    ] = None,
    table_at: Annotated[
        tuple[float, float, float] | None,
        typer.Option("--table-at", metavar="X Y Z", help="Point of its axis, m; default: the path's first."),
    ] = None,
    table_about: Annotated[
        tuple[float, float, float] | None,
        typer.Option(
            "--table-about", metavar="X Y Z", help="Direction of its axis; default: from first to last point."
        ),
    ] = None,
    balance: Annotated[
        float, typer.Option("--balance", metavar="0...1", help="Share of depth against deviation, with both.")
    ] = 0.5,
    joint_step: Annotated[
        float, typer.Option("--joint-step", metavar="DEG", help="Largest step of a joint between points.")
    ] = 15.0,
    table_step: Annotated[float, typer.Option("--table-step", metavar="DEG", help="The same of the table.")] = 10.0,
    limit_margin: Annotated[
        float, typer.Option("--limit-margin", metavar="DEG", help="Least distance to a joint limit.")
    ] = 5.0,
    singularity_margin: Annotated[
        float, typer.Option("--singularity-margin", help="Least singular value of the tool Jacobian (m, rad).")
    ] = 0.05,
    pose: Pose = None,
    joints: Joints = None,
    payload: PayloadMass = 0.0,
    payload_at: PayloadAt = None,
    weight: Weight = "all",
) -> None:
    """Postures along a tool path by its redundancy: largest depth, least deviation or both; the compensated path."""
    from millfrf.steps.robot.path import AskedPath, write_optimised_path
    from millfrf.steps.robot.postures import Asked, loads_of

    asked = AskedPath(
        optimise,
        balance,
        turns,
        table,
        table_at,
        table_about,
        joint_step,
        table_step,
        limit_margin,
        singularity_margin,
    )
    loads = loads_of(payload, payload_at, weight)
    write_optimised_path(robot, path, cutting, (speed, max_depth, depth), asked, Asked(pose, joints), loads, out)
