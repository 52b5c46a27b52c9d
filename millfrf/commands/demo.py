"""`millfrf demo`: the whole chain on the simulated cell; `--conceal`: a blind diagnosis; `--campaign`: recordings."""

from pathlib import Path
from typing import Annotated

import typer

from millfrf.core.terminal import note, say

DEFAULT = Path("millfrf-demo")
FILES = {
    "chain": ("report.html", "cut.toml", "model_tip.json", "model_housing.json", "frf_in_process.h5", "lobes.png"),
    "conceal": (
        "sealed.bin",
        "nominal.json",
        "frf_taps.h5",
        "diagnosis",
        *(f"recordings/{name}.h5" for name in ("taps", "low", "mid", "high")),
    ),
    "campaign": ("campaign.toml", "cut.toml", "concealed.json"),
}
"""What each kind of demonstration writes into its folder, as far as a user's own files may bear such names."""


def demo(
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", metavar="DIR", help="Folder for all results; default: millfrf-demo, or millfrf-demo-2..."
        ),
    ] = None,
    noise: Annotated[float, typer.Option("--noise", help="Noise of every sensor, as a share of its signal.")] = 0.01,
    seed: Annotated[int | None, typer.Option("--seed", help="Of noise and taps.  [default: 0; --conceal: any]")] = None,
    conceal: Annotated[
        bool, typer.Option("--conceal", help="Hide one effect, drawn and sealed; diagnose; open the seal.")
    ] = False,
    campaign: Annotated[
        bool, typer.Option("--campaign", help="Make a campaign's recordings, with things hidden in them.")
    ] = False,
    recordings: Annotated[int, typer.Option("--recordings", help="Of --campaign: recordings in all.")] = 200,
    poses: Annotated[int, typer.Option("--poses", help="Of --campaign: poses of the robot.")] = 20,
) -> None:
    """Mill, record, estimate, fit, calibrate, draw the lobes and report, without hardware, in about a minute."""
    out = _folder(out, "campaign" if campaign else "conceal" if conceal else "chain")
    if campaign:
        _campaign(out, recordings, poses, 0 if seed is None else seed)
        return
    if conceal:
        _concealed(out, noise, seed)
        return
    from millfrf.core.progress import bar
    from millfrf.core.terminal import show
    from millfrf.steps.demo import DemoOptions, comparison_tables, run_demo

    result = run_demo(DemoOptions(out, noise, 0 if seed is None else seed), bar, note)
    for table in comparison_tables(result):
        show(table)
    say(f"report: {result.report.resolve()}")


def _folder(out: Path | None, what: str) -> Path:
    """Where the results go: a folder that was named must not hold such results; else the next that is free."""
    from millfrf.core import free_name, refuse_replacing

    if out is None:
        return free_name(DEFAULT)
    for name in FILES[what]:
        refuse_replacing(out / name)
    return out


def _concealed(out: Path, noise: float, seed: int | None) -> None:
    from millfrf.core.progress import bar
    from millfrf.core.terminal import show
    from millfrf.steps.concealment import ConcealOptions, concealment_table, run_concealed

    result = run_concealed(ConcealOptions(out, noise, seed), bar, note)
    show(concealment_table(result))
    say(f"the diagnosis: {(out / 'diagnosis').resolve()}; {result.seconds:.0f} s in all")


def _campaign(out: Path, recordings: int, poses: int, seed: int) -> None:
    from millfrf.campaign.simulated.make import SimulatedCampaign, make_campaign
    from millfrf.core.progress import bar

    make_campaign(SimulatedCampaign(out, recordings, poses, seed), bar)
    say(f"wrote {out}: {recordings} recordings; run it: millfrf campaign {out / 'campaign.toml'}")
