"""`millfrf robot`: modes, FRFs, stiffness, deviation, lobes, path compensation and diagnosis of robot models."""

from pathlib import Path
from typing import Annotated

import typer

from .diagnosis.diagnose_command import diagnose

robot_app = typer.Typer(
    name="robot",
    help="Robot models as data: a posture gives modes, FRF, stiffness, deviation and stability.",
    add_completion=False,
    rich_markup_mode=None,
)
robot_app.command()(diagnose)

Robot = Annotated[str, typer.Argument(metavar="ROBOT", help="A robot file (.toml), or a name that `robot list` shows.")]
Pose = Annotated[str | None, typer.Option("--pose", help="Posture named in the robot's file; default: its first.")]
Joints = Annotated[
    str | None,
    typer.Option("--joints", metavar="V,V,...", help="Driven joints: degrees; metres of prismatic ones."),
]
At = Annotated[
    tuple[float, float, float] | None, typer.Option("--at", metavar="X Y Z", help="Tip of a vertical tool, m.")
]
Feed = Annotated[float, typer.Option("--feed", metavar="DEG", help="Direction of feed from the base's x, with --at.")]
Turn = Annotated[float, typer.Option("--turn", metavar="DEG", help="Turn of the redundancy, with --at.")]
Redundancy = Annotated[
    str, typer.Option("--redundancy", help="tool: about the tool's axis; table: tool and work about the feed.")
]
Links = Annotated[
    bool, typer.Option("--links", help="Planar robots: the file's link sections too (others always take links in).")
]
PayloadMass = Annotated[float, typer.Option("--payload", metavar="KG", help="Carried besides the file's bodies.")]
PayloadAt = Annotated[
    tuple[float, float, float] | None,
    typer.Option("--payload-at", metavar="X Y Z", help="Its centre of mass from the tip, tool frame, m."),
]
Weight = Annotated[
    str,
    typer.Option(
        "--weight", help="Deflection under weight: all; change: from the first place on (touched off there); none."
    ),
]
Speed = Annotated[float | None, typer.Option("--speed", metavar="RPM", help="Spindle speed of a posture map.")]


@robot_app.command("list")
def list_robots(
    robot: Annotated[str | None, typer.Argument(metavar="[ROBOT]", help="Show what this one assumes.")] = None,
) -> None:
    """Robots that come along; with a name, every number in it that is assumed, and why."""
    from robot_model import assumptions, named_posture, read_robot, robot_names

    if robot is None:
        for name in robot_names():
            typer.echo(f"{name}: {len(assumptions(name))} assumed tables")
        return
    case = read_robot(robot)
    typer.echo(f"postures: {', '.join(case.poses) or 'none'}; {len(named_posture(case, None))} driven joints")
    for line in assumptions(robot):
        typer.echo(line)


@robot_app.command()
def modes(
    robot: Robot,
    pose: Pose = None,
    joints: Joints = None,
    at: At = None,
    feed: Feed = 0.0,
    turn: Turn = 0.0,
    redundancy: Redundancy = "tool",
    links: Links = False,
    count: Annotated[int, typer.Option("--count", help="Modes to show.")] = 10,
    picture: Annotated[
        Path | None, typer.Option("--picture", metavar="FILE", help=".png or .pdf, or .html: a page to turn and play.")
    ] = None,
) -> None:
    """Natural frequencies and damping in a posture, and a picture of the robot and its mode shapes."""
    from .postures import Asked
    from .results import show_modes

    show_modes(robot, Asked(pose, joints, at, feed, turn, redundancy), count, picture, links)


@robot_app.command()
def frf(
    robot: Robot,
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help=".h5: FRF; .json: modal model.")],
    pose: Pose = None,
    joints: Joints = None,
    at: At = None,
    feed: Feed = 0.0,
    turn: Turn = 0.0,
    redundancy: Redundancy = "tool",
    links: Links = False,
    band: Annotated[tuple[float, float], typer.Option("--band", metavar="LO HI", help="Hz.")] = (1.0, 100.0),
    lines: Annotated[int, typer.Option("--lines", help="Frequency lines.")] = 1000,
    sensor: Annotated[
        tuple[float, float, float] | None,
        typer.Option("--sensor", metavar="X Y Z", help="Housing sensor, m from the tip: its motion too (.json)."),
    ] = None,
) -> None:
    """Receptance at the tool tip in a posture, as an FRF file or as the modal model behind it."""
    from .postures import Asked
    from .results import write_receptance

    write_receptance(robot, Asked(pose, joints, at, feed, turn, redundancy), out, band, lines, sensor, links)


@robot_app.command()
def stiffness(
    robot: Robot,
    pose: Pose = None,
    joints: Joints = None,
    at: At = None,
    feed: Feed = 0.0,
    turn: Turn = 0.0,
    redundancy: Redundancy = "tool",
    links: Links = False,
    force: Annotated[float, typer.Option("--force", metavar="N", help="Force to deflect it with.")] = 650.0,
    payload: PayloadMass = 0.0,
    payload_at: PayloadAt = None,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE.json", help="The same as numbers, with the warnings.")
    ] = None,
) -> None:
    """Compliance at the tool tip, softest and stiffest directions, deflection under a force, weight and payload."""
    from .asked_loads import loads_of
    from .loads.statics import show_stiffness
    from .postures import Asked

    asked = Asked(pose, joints, at, feed, turn, redundancy)
    show_stiffness(robot, asked, force, loads_of(payload, payload_at), links, out)


@robot_app.command()
def deviation(
    robot: Robot,
    drill: Annotated[float, typer.Option("--drill", metavar="MM", help="Diameter of the drill.")] = 10.0,
    feed_rev: Annotated[float, typer.Option("--feed-per-rev", metavar="MM", help="Feed a revolution.")] = 0.2,
    x: Annotated[tuple[float, float, int], typer.Option("--x", metavar="LO HI N", help="Area, m.")] = (
        0.6,
        1.4,
        9,
    ),
    y: Annotated[tuple[float, float, int], typer.Option("--y", metavar="LO HI N", help="m.")] = (-0.6, 0.6, 13),
    z: Annotated[float, typer.Option("--z", metavar="M", help="Height of the holes, m.")] = 0.8,
    links: Annotated[bool, typer.Option("--links", help="Flexible links and bearings too, not joints alone.")] = False,
    payload: PayloadMass = 0.0,
    payload_at: PayloadAt = None,
    weight: Weight = "all",
    repeatability: Annotated[
        float | None,
        typer.Option("--repeatability", metavar="MM", help="Pose repeatability, ISO 9283; default: the file's."),
    ] = None,
    position_tolerance: Annotated[
        float | None,
        typer.Option("--position-tolerance", metavar="MM", help="Of the drawing (ISO 1101): does it hold?"),
    ] = None,
    force_error: Annotated[
        float, typer.Option("--force-error", metavar="PERCENT", help="Standard error of the forces; 5 is assumed.")
    ] = 5.0,
    stiffness_error: Annotated[
        float, typer.Option("--stiffness-error", metavar="PERCENT", help="Of joint stiffnesses; 10 is assumed.")
    ] = 10.0,
    out: Annotated[Path | None, typer.Option("--out", metavar="FILE.csv", help="Deviation of every hole.")] = None,
    picture: Annotated[Path | None, typer.Option("--picture", metavar="FILE.png", help="Map of the deviation.")] = None,
) -> None:
    """Deviation of drilled holes over a work area (vertical drill, aluminium), and the position tolerance they need."""
    from robot_model import LoadUncertainty

    from .asked_loads import loads_of
    from .loads.drilled_holes import Accuracy, DrillingArea, show_deviation

    area = DrillingArea(1e-3 * drill, 1e-3 * feed_rev, x, y, z, links)
    known = LoadUncertainty(1e-2 * force_error, 1e-2 * stiffness_error)
    in_metres = [None if value is None else 1e-3 * value for value in (repeatability, position_tolerance)]
    accuracy = Accuracy(in_metres[0], in_metres[1], known)
    show_deviation(robot, area, out, picture, accuracy, loads_of(payload, payload_at, weight))


@robot_app.command()
def lobes(
    robot: Robot,
    cutting: Annotated[Path, typer.Option("--cutting", metavar="CUT.toml", help="Cutter, engagement, coefficients.")],
    max_depth: Annotated[float, typer.Option("--max-depth", metavar="M", help="Largest depth looked at, m.")],
    out: Annotated[Path, typer.Option("--out", metavar="FILE.csv", help="Lobes, or with --angles a posture map.")],
    at: At = None,
    pose: Pose = None,
    joints: Joints = None,
    feed: Feed = 0.0,
    turn: Turn = 0.0,
    redundancy: Redundancy = "table",
    speeds: Annotated[
        tuple[float, float, int] | None, typer.Option("--speeds", metavar="LO HI N", help="Spindle speeds, rpm.")
    ] = None,
    angles: Annotated[
        tuple[float, float, int] | None, typer.Option("--angles", metavar="LO HI N", help="Redundancy angles, degrees.")
    ] = None,
    speed: Speed = None,
    method: Annotated[str, typer.Option("--method", help="Solver of the lobes, as `millfrf lobes`.")] = "certified",
    picture: Annotated[
        Path | None, typer.Option("--picture", metavar="FILE.png", help="Picture of the lobes or the posture map.")
    ] = None,
    depth: Annotated[
        float | None, typer.Option("--depth", metavar="M", help="Cut to mark in the picture of a posture map, m.")
    ] = None,
) -> None:
    """Stability lobes in a posture (--speeds), or the depth limit over a redundancy angle (--angles and --speed)."""
    from .lobes.robot_lobes import write_lobes_in_posture, write_map_over_redundancy
    from .postures import Asked

    asked = Asked(pose, joints, at, feed, turn, redundancy)
    if angles is not None:
        write_map_over_redundancy(robot, asked, cutting, angles, speed, max_depth, out, (picture, depth))
    else:
        write_lobes_in_posture(robot, asked, cutting, speeds, max_depth, method, out, picture)


@robot_app.command("map")
def map_command(
    robot: Robot,
    picture: Annotated[Path, typer.Option("--picture", metavar="FILE.png", help="Map over the area.")],
    x: Annotated[tuple[float, float, int], typer.Option("--x", metavar="LO HI N", help="Area, m.")] = (0.5, 1.4, 19),
    y: Annotated[tuple[float, float, int], typer.Option("--y", metavar="LO HI N", help="m.")] = (-0.7, 0.7, 29),
    z: Annotated[float, typer.Option("--z", metavar="M", help="Height of the tool's tip, m.")] = 0.8,
    feed: Feed = 0.0,
    cutting: Annotated[
        Path | None, typer.Option("--cutting", metavar="CUT.toml", help="Depth limits too, at one spindle speed.")
    ] = None,
    speed: Speed = None,
    max_depth: Annotated[float, typer.Option("--max-depth", metavar="M", help="Largest depth looked at, m.")] = 0.02,
) -> None:
    """Lowest natural frequency of a vertical tool over an area, and with --cutting the depth limit."""
    from .results import write_workspace_map

    write_workspace_map(robot, picture, (x, y, z, feed), cutting, speed, max_depth)


@robot_app.command()
def compensate(
    robot: Robot,
    path: Annotated[Path, typer.Argument(metavar="PATH.csv", help="x_m y_m z_m rx_rad ry_rad rz_rad fx_n fy_n fz_n.")],
    out: Annotated[Path, typer.Option("--out", metavar="FILE.csv", help="Corrected path.")],
    joints: Joints = None,
    pose: Pose = None,
    payload: PayloadMass = 0.0,
    payload_at: PayloadAt = None,
    weight: Weight = "all",
) -> None:
    """Move a tool path against the deflection that its forces, the robot's weight and a payload will cause."""
    from .asked_loads import loads_of
    from .postures import Asked
    from .results import write_compensation

    write_compensation(robot, path, Asked(pose, joints), out, loads_of(payload, payload_at, weight))
