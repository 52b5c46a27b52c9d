"""Step ``robot modes``: natural frequencies and mode shapes in a posture."""

from pathlib import Path
from typing import Annotated

from annotated_types import Ge

from millfrf.core import Real, writing_whole_file
from millfrf.core.steps import File, Writes, step
from millfrf.core.terminal import Table, say_written, show, tell, warn
from millfrf.figures import save_figure
from millfrf.robot_model import (
    PostureResult,
    SpatialCase,
    close_loops,
    in_posture,
    modes_at,
    read_robot,
    shown_values,
)

from ..given import At, Degrees, Joints, Pose, Robot, Turning
from .postures import cut_place, mechanism_of, posture_of, spatial
from .robot_page import mode_page, robot_figure


@step
def robot_modes(
    robot: Robot,
    /,
    *,
    pose: Pose = None,
    joints: Joints = None,
    at: At = None,
    feed: Degrees = 0.0,
    turn: Degrees = 0.0,
    redundancy: Turning = "tool",
    links: bool = False,
    modes: Annotated[int, Ge(1)] = 10,
    picture: Annotated[File | None, Writes(suffixes=(".png", ".pdf", ".html"))] = None,
) -> PostureResult:
    """Natural frequencies and damping in a posture, and a picture of the robot and its mode shapes.

    Parameters
    ----------
    robot
        Robot file (.toml), or a name that `robot list` shows.
    pose
        Posture named in the robot's file; without it the first one.
    joints : deg
        Values of the driven joints; of prismatic joints in metres.
    at : m
        Place of the tip of a vertical tool, instead of a posture.
    feed : deg
        Direction of the feed from the base's x, with --at.
    turn : deg
        Turn of the redundancy, with --at.
    redundancy
        What turns, with --at: the robot about the tool's axis (tool), or tool and workpiece about the feed (table).
    links
        Include the flexible link sections of a planar robot's file; a robot in space always includes its links.
    modes
        Number of modes to show.
    picture
        Picture to write; .html: a page to turn the robot and play its modes.

    Returns
    -------
    PostureResult
        All natural frequencies, the modal model at the tool tip, the compliance and the warnings.

    Raises
    ------
    InputError
        A posture that the robot does not reach, or a file without masses.

    Examples
    --------
    ::

        $ millfrf robot modes kuka_kr90_r3100 --joints 0,-10,100,0,90,0 --picture modes.html
    """
    case = read_robot(robot)
    driven, axes = posture_of(case, pose, joints, cut_place(at, feed, turn, redundancy))
    result = in_posture(case, driven, axes, links=links)
    model = result.known_model()
    ratios = {f"{f:.6f}": z for f, z in zip(model.natural_frequencies, model.damping_ratios, strict=True)}
    shown = [(f, ratios.get(f"{f:.6f}")) for f in result.frequencies[:modes]]
    posture = shown_values(mechanism_of(case), driven)
    tell(
        lambda: {
            "posture": posture,
            "modes": [{"frequency_hz": frequency, "damping_ratio": ratio} for frequency, ratio in shown],
        }
    )
    rows = tuple(
        (str(i + 1), f"{frequency:.3f}", "overdamped" if ratio is None else f"{100 * ratio:.2f}")
        for i, (frequency, ratio) in enumerate(shown)
    )
    show(Table(f"Modes in the posture {posture}", ("mode", "frequency (Hz)", "damping ratio (%)"), rows))
    warn(result.warnings)
    if picture is not None:
        draw_modes(Path(picture), spatial(case), driven)
        say_written([picture])
    return result


def draw_modes(path: Path, case: SpatialCase, driven: Real) -> None:
    """Write a picture of the first four modes, or (``.html``) a page on which they move."""
    modes = modes_at(case.robot, close_loops(case.robot.mechanism, driven))
    if path.suffix.lower() != ".html":
        save_figure(robot_figure(modes), path)
        return
    with writing_whole_file(path) as unfinished:
        unfinished.write_text(mode_page(case.name, modes), encoding="utf-8")
