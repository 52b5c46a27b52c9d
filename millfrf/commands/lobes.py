"""`millfrf lobes`: depth limit over spindle speed."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from foundation import InputError

from ..options import Output, check_output


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
) -> None:
    """Stability lobes from a modal model or straight from a measured FRF."""
    from estimation import read_frf
    from modal_fit import ModalModel, read_modal_model
    from stability import write_lobes

    from ..chain.cuts.lobes import compute_lobes, lobes_summary, mode_coupling_line, speed_axis
    from ..file_kinds import FRF, MODEL, kind_of
    from ..gate import (
        check_depth,
        check_speeds,
        lowest_frequency,
        read_checked_cutting,
        rigid_directions,
        stored_doubts,
    )
    from ..progress import bar
    from ..provenance import of_lobes

    check_output(out, (".csv",))
    kind = kind_of(dynamics)
    if kind not in (FRF, MODEL):
        raise InputError(f"{dynamics} is a file of {kind}; lobes need a modal model or an FRF at the tool tip")
    process, doubts = read_checked_cutting(cutting)
    known = read_frf(dynamics) if kind == FRF else read_modal_model(dynamics)
    doubts += [*check_depth(max_depth, process), *rigid_directions(known)]
    mode = lowest_frequency(known.natural_frequencies) if isinstance(known, ModalModel) else None
    doubts += check_speeds(speeds, process, mode)
    result = compute_lobes(known, process, speed_axis(*speeds), max_depth, method, bar, dynamics.name)
    result = replace(result, warnings=(*stored_doubts(dynamics), *doubts, *result.warnings))
    asked = {"speeds_rpm": speeds, "max_depth_m": max_depth, "method": method}
    write_lobes(out, result, provenance=of_lobes([dynamics, cutting], asked))
    for warning in result.warnings:
        typer.echo(f"warning: {warning}", err=True)
    typer.echo(f"wrote {out}: {lobes_summary(result, max_depth)}")
    if kind == MODEL:
        typer.echo(mode_coupling_line(read_modal_model(dynamics), process, max_depth))
