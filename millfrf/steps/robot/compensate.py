"""Step ``robot compensate``: correct a tool path for deflection."""

from functools import partial
from typing import Annotated

import numpy as np

from millfrf.core import Real
from millfrf.core.progress import progress
from millfrf.core.provenance import origin
from millfrf.core.steps import File, Reads, Writes, step
from millfrf.core.terminal import say, say_written, warn
from millfrf.figures import save_figure
from millfrf.robot_model import (
    CompensatedPath,
    SpatialRobot,
    ToolPath,
    close_loops,
    compensate_path,
    read_robot,
    read_tool_path,
    write_compensated_path,
)

from ..given import Joints, Kilograms, NearTip, Picture, Pose, Robot, Weight
from .pictures import compensation_figure
from .postures import Loads, loads_of, posture_of, spatial, start_of_path
from .uncertainty import deviation_sentence

CORRECTED_PART = {
    "all": "all of it is corrected (--weight all)",
    "change": "only its change from the first place is corrected (--weight change)",
    "none": "none of it is corrected (--weight none)",
}


@step
def compensate(
    robot: Robot,
    path: Annotated[File, Reads("PATH.csv")],
    /,
    *,
    out: Annotated[File | None, Writes(suffixes=(".csv",), needed=True)] = None,
    joints: Joints = None,
    pose: Pose = None,
    payload: Kilograms = 0.0,
    payload_at: NearTip = None,
    weight: Weight = "all",
    picture: Picture = None,
) -> CompensatedPath:
    """Correct a tool path for the deflection under its forces, the robot's weight and a payload.

    Parameters
    ----------
    robot
        Robot file (.toml), or a name that `robot list` shows.
    path
        Path of the tool tip: columns x_m y_m z_m rx_rad ry_rad rz_rad fx_n fy_n fz_n.
    out
        Corrected path to write.
    joints : deg
        Values of the driven joints near which the path begins; of prismatic joints in metres.
    pose
        Posture named in the robot's file near which the path begins; without it the first one.
    payload : kg
        Mass that the robot carries besides the bodies of its file.
    payload_at : m
        Centre of mass of the payload from the tip, in the tool frame; without it the tip.
    weight
        Deflection under weight that counts: all; its change from the first place, where the work was touched off; none.
    picture
        Picture of the deviation along the path, before and after, to write.

    Returns
    -------
    CompensatedPath
        Corrected path with its deviations and warnings.

    Raises
    ------
    InputError
        A path that the robot does not reach, or a payload without mass.

    Examples
    --------
    ::

        $ millfrf robot compensate kuka_kr90_r3100 path.csv --payload 30 --out corrected.csv
    """
    loads = loads_of(payload, payload_at, weight)
    case = spatial(read_robot(robot))
    warn(case.assumed)
    start = posture_of(case, pose, joints)[0]
    close_loops(case.robot.mechanism, start)
    nominal = read_tool_path(path)
    if pose is None and joints is None:  # the file's first posture may be on a branch beyond the limits
        start = start_of_path(case.robot, nominal, start)
    with progress("compensating"):
        result = compensate_path(case.robot, nominal, start, payload=loads.payload, weight=weight)
        uncertain = deviation_sentence(case, partial(_deviations, nominal, start, loads))
    if out is not None:
        made_of = origin("robot compensate", [robot, path], {"payload_and_weight": loads})
        write_compensated_path(out, result, made_of)
    if picture is not None:
        save_figure(compensation_figure(nominal, result), picture)
        say_written([picture])
    before, after = (1e3 * np.linalg.norm(moved[:, :3], axis=1) for moved in (result.deviations, result.left))
    say_written(
        [out],
        f"predicted deviation mean {before.mean():.3f} mm, largest {before.max():.3f} mm; after correction "
        f"{1e3 * after.max():.2g} um by the same model",
    )
    _say_weight(case.robot, result, loads)
    if uncertain:
        say(uncertain)
    warn(result.warnings)
    return result


def _say_weight(robot: SpatialRobot, result: CompensatedPath, loads: Loads) -> None:
    """Print the deflection under weight, and its corrected part."""
    sag = 1e3 * np.linalg.norm(result.weight[:, :3], axis=1)
    change = 1e3 * np.linalg.norm((result.weight - result.weight[0])[:, :3], axis=1)
    own = "the robot and" if robot.bodies else "the robot unknown (its file gives no bodies); of"
    say(
        f"weight of {own} a payload of {loads.payload.mass:g} kg: largest deflection {sag.max():.3f} mm, "
        f"changes by up to {change.max():.3f} mm from the first place; {CORRECTED_PART[loads.weight]}"
    )


def _deviations(path: ToolPath, start: Real, loads: Loads, robot: SpatialRobot) -> Real:
    return compensate_path(robot, path, start, payload=loads.payload, weight=loads.weight).deviations
