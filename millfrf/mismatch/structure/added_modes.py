"""Added modes of a fit that are no modes of the structure: lines without damping, and harmonics of other modes."""

import numpy as np

from ..models.fitting import Fit
from ..models.hypothesis import Hypothesis
from ..physics.linear_causes import MissingMode
from ..physics.wider_forms import families

# Number of standard errors by which the damping of a further mode must differ from zero. In the cases of two trials and
# in harder practice cases, it was at least 8 for 22 modes that existed, and 0.8 for a mode that did not exist
MIN_DAMPING_ERRORS = 2.0

HARMONICS = (2, 3)  # lowest orders at which even and odd forces of a joint repeat the frequency of a mode


def undamped_modes(fitted: Fit) -> list[int]:
    """Return the indices of causes whose added mode has no significant damping; it may be hum or a band edge."""
    shape = fitted.hypothesis.shape
    spread = np.sqrt(np.maximum(shape.modal_rows(np.diag(fitted.covariance)), 0.0))[shape.nominal_modes :, 1]
    places = [k for k, cause in enumerate(fitted.hypothesis.causes) if isinstance(cause.physics, MissingMode)]
    ratios = fitted.hypothesis.model.damping_ratios[shape.nominal_modes :]
    errors = spread * shape.lab.damping * ratios
    return [k for k, ratio, error in zip(places, ratios, errors, strict=True) if ratio < MIN_DAMPING_ERRORS * error]


def harmonics_of_modes(hypothesis: Hypothesis) -> list[int]:
    """Return the indices of causes whose added mode lies at a harmonic of another mode under a nonlinear joint.

    Under the force of a joint, the motion of a mode contains multiples of its frequency. If the named law has not
    exactly the true form, an added mode there takes up what the law leaves. It lies at a harmonic of order k if
    ``|f_added - k f| <= k zeta f + zeta_added f_added``: the half-power bands of the harmonic and of the added mode
    overlap.
    """
    if all(families(cause.law()) == "t" for cause in hypothesis.laws):
        return []  # a stiffness that changes with time makes no harmonics
    places = [k for k, cause in enumerate(hypothesis.causes) if isinstance(cause.physics, MissingMode)]
    count, model = hypothesis.shape.nominal_modes, hypothesis.model
    halves = model.damping_ratios * model.natural_frequencies
    harmonics = [(k * model.natural_frequencies[:count], k * halves[:count]) for k in HARMONICS]
    return [
        place
        for place, frequency, half in zip(places, model.natural_frequencies[count:], halves[count:], strict=True)
        if any((np.abs(frequency - centres) <= widths + half).any() for centres, widths in harmonics)
    ]
