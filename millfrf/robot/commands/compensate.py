"""`millfrf robot compensate`: a tool path corrected for deflection."""

from pathlib import Path
from typing import Annotated

import typer

from .options import Joints, PayloadAt, PayloadMass, Pose, Robot, Weight


def compensate(
    robot: Robot,
    path: Annotated[Path, typer.Argument(metavar="PATH.csv", help="x_m y_m z_m rx_rad ry_rad rz_rad fx_n fy_n fz_n.")],
    out: Annotated[Path, typer.Option("--out", metavar="FILE.csv", help="Corrected path.")],
    joints: Joints = None,
    pose: Pose = None,
    payload: PayloadMass = 0.0,
    payload_at: PayloadAt = None,
    weight: Weight = "all",
    picture: Annotated[
        Path | None, typer.Option("--picture", metavar="FILE", help="Deviation along the path, before and after.")
    ] = None,
) -> None:
    """Move a tool path against the deflection that its forces, the robot's weight and a payload will cause."""
    from millfrf.steps.robot.common import write_compensation
    from millfrf.steps.robot.postures import Asked, loads_of

    write_compensation(robot, path, Asked(pose, joints), out, loads_of(payload, payload_at, weight), picture)
