"""Judgement of an alternating motion with the model: is it forced by runout, or is it period doubling?"""

from dataclasses import replace

import numpy as np

from ..floquet import multipliers
from .fitted_depth import ModelledCut, fitted_depth
from .motion import Evidence
from .verdict import STABLE, ChatterVerdict

_LARGEST = 10.0  # largest depth that is believed over the best; a wider range tells nothing


def told_by_model(
    evidence: Evidence, cut: ModelledCut, derivatives: tuple[int, ...], doubled: ChatterVerdict
) -> ChatterVerdict | None:
    """Give the verdict on motion that alternates, where the error of the depth does not change the cut's stability.

    Parameters
    ----------
    evidence
        Evidence gathered from the recording.
    cut
        Cutter, structure and channels of the tip.
    derivatives : (n_channels,)
        Number of times each channel is differentiated: 2 for acceleration, 1 for velocity, 0 for displacement.
    doubled
        The verdict of period doubling so far.

    Returns
    -------
    ChatterVerdict or None
        None where the model does not tell.
    """
    fitted = fitted_depth(evidence, cut, derivatives)
    if fitted is None or fitted.low <= 0 or fitted.high > _LARGEST * fitted.depth:
        return None
    speed = 2 * np.pi * evidence.track.mean_frequency
    sizes = [
        multipliers(cut.model, cut.process, speed, depth).spectral_radius
        for depth in (fitted.low, fitted.depth, fitted.high)
    ]
    if min(sizes) < 1 <= max(sizes):
        return None
    told = (
        f"with the model, the motion that alternates from tooth to tooth is that of a cut of {1e3 * fitted.depth:.3g} "
        f"mm ({1e3 * fitted.low:.3g} to {1e3 * fitted.high:.3g} mm), whose largest multiplier is {sizes[1]:.3f}"
    )
    warning = "told with the model, of which the verdict is therefore no test"
    if min(sizes) >= 1:
        return replace(doubled, reason=told, warnings=(warning,))
    return replace(doubled, kind=STABLE, frequency=float("nan"), p_value=1.0, reason=told, warnings=(warning,))
