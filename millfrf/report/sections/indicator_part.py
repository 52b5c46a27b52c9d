"""Mode indicators of the FRF behind a fit: a picture, and peaks that no mode explains."""

import numpy as np

from estimation import Frf
from millfrf.figures import indicator_figure, zoomed_indicators
from modal_fit import ComplexModeIndicator, ModalModel, complex_mode_indicator, multivariate_mode_indicator

from ..section import Picture, picture_of

Band = tuple[float, float]

PROMINENT = 2.0
"""Factor over its valleys from which a peak is told."""


def has_lines(frf: Frf, band: Band) -> bool:
    """Say whether enough lines lie in the band for a curve."""
    inside = frf.valid & (frf.frequencies > 0) & (frf.frequencies >= band[0]) & (frf.frequencies <= band[1])
    return int(inside.sum()) > 2


def indicator_part(name: str, frf: Frf, model: ModalModel, band: Band) -> tuple[Picture, tuple[str, ...]]:
    """Make the picture of both indicators in the band of a fit, and a sentence on peaks without a mode.

    Parameters
    ----------
    name
        Name of the model's file.
    frf
        FRF to which the model was fitted.
    model
        Modal model whose modes are marked.
    band : Hz
        Lowest and highest frequency of the fit.
    """
    indicator, multivariate = complex_mode_indicator(frf, band), multivariate_mode_indicator(frf, band)
    single = len(multivariate.references) == 1
    caption = (
        f"{name}: mode indicators of the FRF. (a) Complex mode indicator (CMIF), the singular values of the FRF "
        "matrix: a mode is a peak of the first curve; two close modes are peaks of two curves at one frequency. (b) "
        + ("Mode indicator (MIF)" if single else "Multivariate mode indicator (MIF)")
        + ", the share of the motion in phase with the forces: 0 at a real mode that stands alone."
    )
    zoomed = zoomed_indicators(indicator, multivariate, model)
    words = f"Mode indicators of {name} over frequency"
    picture = picture_of(indicator_figure(indicator, multivariate, model), caption, words, zoomed=zoomed)
    return picture, _unexplained(name, indicator, model)


def _unexplained(name: str, indicator: ComplexModeIndicator, model: ModalModel) -> tuple[str, ...]:
    """Peaks of the first curve further from every mode than its bandwidth and two lines."""
    step = float(np.median(np.diff(indicator.frequencies)))
    reach = 2 * np.maximum(2 * model.damping_ratios * model.natural_frequencies, step)
    alone = [
        f"{peak.frequency:.2f} Hz"
        for peak in indicator.peaks(PROMINENT)
        if peak.curve == 1 and (np.abs(model.natural_frequencies - peak.frequency) > reach).all()
    ]
    if not alone:
        return ()
    one = len(alone) == 1
    return (
        f"{name}: the CMIF has {'a peak' if one else 'peaks'} without a mode at {', '.join(alone)}: a mode that was "
        "left out, a frequency of the surroundings, or noise.",
    )
