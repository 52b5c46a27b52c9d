"""`millfrf lobes`: depth limit over spindle speed."""

from pathlib import Path
from typing import Annotated

import typer

from millfrf.core.terminal import say, tell

from ..options import Output, check_output, echo_warnings


def lobes(
    dynamics: Annotated[Path, typer.Argument(metavar="MODEL.json|FRF.h5", help="Dynamics at the tool tip.")],
    cutting: Annotated[Path, typer.Option("--cutting", metavar="CUT.toml", help="Cutter, engagement, coefficients.")],
    speeds: Annotated[
        tuple[float, float, int], typer.Option("--speeds", metavar="LO HI N", help="Spindle speeds, rpm.")
    ],
    max_depth: Annotated[float, typer.Option("--max-depth", metavar="M", help="Largest depth looked at, m.")],
    out: Output,
    method: Annotated[
        str,
        typer.Option(
            "--method",
            help="certified (collocation verified by multipliers; of an FRF multi-frequency), or a solver by name: "
            "zero-order, nyquist, multi-frequency, collocation or semi-discretization.",
        ),
    ] = "certified",
    picture: Annotated[
        Path | None, typer.Option("--picture", metavar="FILE", help="Picture: .png, .pdf or .svg, islands drawn.")
    ] = None,
) -> None:
    """Stability lobes from a modal model or straight from a measured FRF."""
    from millfrf.core.file_kinds import MODEL, kind_of
    from millfrf.core.progress import bar
    from millfrf.core.provenance import of_lobes
    from millfrf.cutting import read_cutting_process
    from millfrf.stability import write_lobes
    from millfrf.steps.answers import lobes_answer
    from millfrf.steps.face_lobes import lobes as lobes_of
    from millfrf.steps.lobes import draw_lobes_of, lobes_summary, mode_coupling_line
    from modal_fit import read_modal_model

    check_output(out, (".csv",))
    if picture is not None:
        check_output(picture, (".png", ".pdf", ".svg"))
    result = lobes_of(dynamics, cutting, speeds=speeds, max_depth=max_depth, method=method, progress=bar)
    asked = {"speeds_rpm": speeds, "max_depth_m": max_depth, "method": method}
    write_lobes(out, result, provenance=of_lobes([dynamics, cutting], asked))
    if picture is not None:
        draw_lobes_of(dynamics, cutting, result, max_depth, picture)
    echo_warnings(result.warnings)
    tell(lambda: {"max_depth_m": max_depth, **lobes_answer(result)})
    say(f"wrote {out}{'' if picture is None else f' and {picture}'}: {lobes_summary(result, max_depth)}")
    if kind_of(dynamics) == MODEL:
        say(mode_coupling_line(read_modal_model(dynamics), read_cutting_process(cutting), max_depth))
