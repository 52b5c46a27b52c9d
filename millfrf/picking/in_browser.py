"""`millfrf fit --pick`: an automatic fit, the page, the file of the choice."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from estimation import read_frf
from millfrf.core import InputError

from ..chain import FitOptions, fit_model
from ..file_kinds import FRF, kind_of
from ..options import check_output
from ..progress import Progress
from ..terminal import say
from .picked_file import write_picked
from .serving import pick_poles
from .session import PickSession


def check_pick(pick: Path, out: Path, poles: Path | None, candidates: Path | None, files: Sequence[Path]) -> None:
    """Refuse a choice that cannot be made or written, before anything is computed.

    Raises
    ------
    InputError
        Poles that are named already, candidates for another picker, recordings, or a name that cannot be written.
    """
    if poles is not None:
        raise InputError("--pick chooses the poles that --poles would name; give one of the two")
    if candidates is not None:
        raise InputError("--candidates is for another picker; leave it out beside --pick")
    if kind_of(files[0]) != FRF:
        raise InputError("--pick shows the poles of an FRF; estimate one from these recordings first")
    check_output(pick, (".toml",), [out, *files])


def pick_in_browser(pick: Path, frf: Path, options: FitOptions, progress: Progress) -> Path:
    """Fit, show the page until a choice is saved, and write the choice.

    Parameters
    ----------
    pick
        File of the choice, ``.toml``.
    frf
        File of the FRF.
    options
        Band, and where it is given highest order and number of modes of the automatic fit.
    progress
        Shows progress of the automatic fit.

    Returns
    -------
    Path
        The file of the choice, for ``--poles``.

    Raises
    ------
    InputError
        An FRF or a band that cannot be fitted.
    MillfrfError
        The page was left without a choice.
    """
    measured = read_frf(frf)
    automatic = fit_model(measured, replace(options, poles=None, refine=False), progress, frf.name)
    chosen = pick_poles(PickSession(frf.name, measured, automatic, options.max_order), say)
    write_picked(pick, chosen, frf, options.band)
    say(f"wrote {pick}: {len(chosen)} poles; --poles {pick} repeats the fit")
    return pick
