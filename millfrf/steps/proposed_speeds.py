"""Spindle speeds to try after a cut that chatters, and the depths that a model allows there."""

import numpy as np

from millfrf.core import InputError
from millfrf.cutting import MillingProcess
from millfrf.reports.recommendation import shown_depth
from millfrf.stability import JudgedCut
from modal_fit import ModalModel

from .lobes import compute_lobes
from .settings import RPM

IN_STEP = "where teeth pass in step with the chatter"


def proposal_in_words(cut: JudgedCut, teeth: int, model: ModalModel | None, process: MillingProcess | None) -> str:
    """Return a sentence on the speeds to try, with the depth limits there; empty if none is proposed.

    A speed in step with the chatter has the largest limit near it, which may still be below the depth of the cut.

    Parameters
    ----------
    cut
        Verdict on a recording.
    teeth
        Number of cutting edges.
    model
        Receptance at the tip; None: not known, and no limit is given.
    process
        Milling process; None likewise.
    """
    speeds = cut.proposed_rpm(teeth)
    if not speeds:
        return ""
    typed = f"try a spindle speed of {' or '.join(f'{rpm:.0f}' for rpm in speeds)} rpm, {IN_STEP}"
    if model is None or process is None:
        return f"{typed}; as deep a cut may chatter there, too: --model and --cutting give the limits"
    try:
        lobes = compute_lobes(model, process, np.array(speeds) * RPM, process.diameter)
    except InputError as error:
        return f"{typed}; limits there are not known: {error}"
    shown = " and ".join(
        f"{shown_depth(limit) if np.isfinite(limit) else 'none found'} ({status})" if not np.isnan(limit) else status
        for limit, status in zip(lobes.depth_limits, lobes.status, strict=True)
    )
    return f"{typed}; depth limits of the model there: {shown}"
