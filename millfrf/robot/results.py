"""What the robot commands do: read, compute, print a table, write a file."""

from pathlib import Path

import numpy as np
import typer

from cutting import read_cutting_process
from estimation import write_frf
from foundation import InputError
from modal_fit import write_modal_model
from robot_model import (
    PostureResult,
    cell_structure_at,
    close_loops,
    compensate_path,
    in_posture,
    named_posture,
    read_robot,
    read_tool_path,
    shown_values,
    tool_down,
    write_compensated_path,
)

from ..commands.options import check_band, check_output
from ..progress import bar
from ..tables import Table, show
from .posture_maps import depth_over_places
from .postures import Asked, mechanism_of, posture_of, spatial

RPM = np.pi / 30


def show_modes(robot: str, asked: Asked, count: int, picture: Path | None) -> None:
    """Table of modes; a picture or a page where asked."""
    if picture is not None:
        check_output(picture, (".png", ".pdf", ".html"))
    case = read_robot(robot)
    driven, axes = posture_of(case, asked)
    result = in_posture(case, driven, axes)
    model = result.known_model()
    kept = {f"{f:.6f}": f"{100 * z:.2f}" for f, z in zip(model.natural_frequencies, model.damping_ratios, strict=True)}
    shown = [(f, kept.get(f"{f:.6f}", "overdamped")) for f in result.frequencies[:count]]
    rows = tuple((str(i + 1), f"{f:.3f}", ratio) for i, (f, ratio) in enumerate(shown))
    show(
        Table(
            f"Modes in the posture {shown_values(mechanism_of(case), driven)}",
            ("mode", "frequency (Hz)", "damping ratio (%)"),
            rows,
        )
    )
    warn(result)
    if picture is not None:
        from .picture import draw_modes

        draw_modes(picture, spatial(case), driven)
        typer.echo(f"wrote {picture}")


def write_receptance(
    robot: str,
    asked: Asked,
    out: Path,
    band: tuple[float, float],
    lines: int,
    sensor: tuple[float, float, float] | None = None,
) -> None:
    """FRF or modal model at the tool tip; with a sensor, a modal model with the housing's motion."""
    check_output(out, (".json",) if sensor is not None else (".h5", ".json"))
    check_band(band)
    if lines < 2:
        raise InputError(f"{lines} frequency lines: give 2 or more")
    case = read_robot(robot)
    driven, axes = posture_of(case, asked)
    result = in_posture(case, driven, axes)
    model = result.known_model()
    if sensor is not None:
        model = cell_structure_at(spatial(case).robot, driven, np.array(sensor), axes=axes)
    if out.suffix == ".json":
        write_modal_model(out, model)
    else:
        write_frf(out, model.frf(np.linspace(*band, lines)))
    warn(result)
    typer.echo(f"wrote {out}: {len(model.poles)} modes from {model.natural_frequencies.min():.2f} Hz")


def show_stiffness(robot: str, asked: Asked, force: float) -> None:
    """Compliance table, principal directions, deflection."""
    case = read_robot(robot)
    driven, axes = posture_of(case, asked)
    result = in_posture(case, driven, axes)
    names = [label.split(":")[1] for label in result.labels]
    rows = tuple((name, *(f"{v:.3e}" for v in row)) for name, row in zip(names, result.compliance, strict=True))
    show(
        Table(
            f"Compliance at the tool (m/N, rad/N m), posture {shown_values(mechanism_of(case), driven)}",
            ("", *names),
            rows,
        )
    )
    moving = [i for i, name in enumerate(names) if "R" not in name]
    values, directions = np.linalg.eigh(result.compliance[np.ix_(moving, moving)])
    for value, direction in zip(values[::-1], directions.T[::-1], strict=True):
        parts = ", ".join(f"{names[i][1:]} {d:+.2f}" for i, d in zip(moving, direction, strict=True))
        typer.echo(f"{1e-6 / value:8.3f} N/um along ({parts})")
    typer.echo(f"largest deflection under {force:g} N: {1e3 * force * values[-1]:.3f} mm")
    warn(result)


def write_workspace_map(
    robot: str,
    picture: Path,
    area: tuple[tuple[float, float, int], tuple[float, float, int], float, float],
    cutting: Path | None,
    speed: float | None,
    max_depth: float,
) -> None:
    """Map of the lowest frequency, and of the depth limit where a cut is given."""
    from .picture import draw_workspace

    check_output(picture, (".png", ".pdf"))
    if (cutting is None) != (speed is None):
        raise InputError("a map of depth limits needs both --cutting CUT.toml and --speed RPM")
    x, y, z, feed = area
    case = spatial(read_robot(robot))
    places = [tool_down([u, v, z], np.radians(feed)) for u in np.linspace(*x) for v in np.linspace(*y)]
    process = None if cutting is None else read_cutting_process(cutting)
    with bar("map"):
        limits, lowest = depth_over_places(case.robot, places, process, (speed or 1.0) * RPM, max_depth, workers=2)
    if np.isnan(lowest).all():
        raise InputError("no place of the area is reached; move --x, --y or --z")
    draw_workspace(picture, places, (x[2], y[2]), lowest, limits)
    typer.echo(f"lowest frequency {np.nanmin(lowest):.2f} to {np.nanmax(lowest):.2f} Hz")
    if process is not None:
        typer.echo(f"depth limit {1e3 * np.nanmin(limits):.2f} to {1e3 * np.nanmax(limits):.2f} mm")
    typer.echo(f"wrote {picture}: {np.isfinite(lowest).sum()} of {len(places)} places reached")


def write_compensation(robot: str, path: Path, asked: Asked, out: Path) -> None:
    """Corrected path, and what it is worth."""
    check_output(out, (".csv",))
    case = spatial(read_robot(robot))
    start = posture_of(case, asked)[0] if asked.joints or asked.pose else named_posture(case, None)
    close_loops(case.robot.mechanism, start)
    with bar("compensating"):
        result = compensate_path(case.robot, read_tool_path(path), start)
    write_compensated_path(out, result)
    before, after = (np.linalg.norm(moved[:, :3], axis=1) for moved in (result.deviations, result.left))
    typer.echo(
        f"wrote {out}: predicted deviation mean {1e3 * before.mean():.3f} mm, largest {1e3 * before.max():.3f} mm; "
        f"after correction {1e6 * after.max():.2g} um by the same model"
    )


def warn(result: PostureResult) -> None:
    """Print a posture's warnings."""
    for warning in result.warnings:
        typer.echo(f"warning: {warning}", err=True)
