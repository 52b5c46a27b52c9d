"""Step ``demo``: the whole chain on the simulated cell, a blind diagnosis, or the recordings of a campaign."""

from pathlib import Path
from typing import Annotated, Any

from millfrf.campaign.simulated.make import SimulatedCampaign, make_campaign
from millfrf.core import free_name, refuse_replacing
from millfrf.core.steps import File, Writes, step
from millfrf.core.terminal import say, show

from .concealment import ConcealOptions, concealment_table, run_concealed
from .whole_chain import DemoOptions, comparison_tables, run_demo

DEFAULT = Path("millfrf-demo")
# files of each kind of demonstration that must not replace files of the user
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


@step
def demo(
    *,
    out: Annotated[File | None, Writes("DIR")] = None,
    noise: float = 0.01,
    seed: int | None = None,
    conceal: bool = False,
    campaign: bool = False,
    recordings: int = 200,
    poses: int = 20,
) -> Any:
    """Mill, record, estimate, fit, calibrate, draw the lobes and report, without hardware, in about a minute.

    Parameters
    ----------
    out
        Folder for all results; without it millfrf-demo, or millfrf-demo-2...
    noise
        Noise of every sensor, as a share of its signal.
    seed
        Seed of noise and taps; without it 0, with --conceal any.
    conceal
        Hide one random effect in a sealed file, diagnose it, and open the seal.
    campaign
        Make the recordings of a campaign with hidden effects.
    recordings
        Number of recordings, with --campaign.
    poses
        Number of poses of the robot, with --campaign.

    Returns
    -------
    DemoResult, ConcealResult or None
        Results, compared with the truth.

    Raises
    ------
    InputError
        Invalid options, or a folder that cannot be created.
    MillfrfError
        A step failed.

    Examples
    --------
    ::

        $ millfrf demo --out millfrf-demo
    """
    folder = _folder(out, "campaign" if campaign else "conceal" if conceal else "chain")
    if campaign:
        make_campaign(SimulatedCampaign(folder, recordings, poses, 0 if seed is None else seed))
        say(f"wrote {folder}: {recordings} recordings; run it: millfrf campaign {folder / 'campaign.toml'}")
        return None
    if conceal:
        concealed = run_concealed(ConcealOptions(folder, noise, seed))
        show(concealment_table(concealed))
        say(f"the diagnosis: {(folder / 'diagnosis').resolve()}; {concealed.seconds:.0f} s in all")
        return concealed
    result = run_demo(DemoOptions(folder, noise, 0 if seed is None else seed))
    for table in comparison_tables(result):
        show(table)
    say(f"report: {result.report.resolve()}")
    return result


def _folder(out: File | None, kind: str) -> Path:
    """Return the folder of results; without a given folder, the next free name.

    A given folder must not contain results of a demonstration.
    """
    if out is None:
        return free_name(DEFAULT)
    for name in FILES[kind]:
        refuse_replacing(Path(out) / name)
    return Path(out)
