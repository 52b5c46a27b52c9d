"""Added modes of a fit that are no modes of the structure: without damping, harmonics or copies of other modes."""

import numpy as np

from modal_fit import ModalModel

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


def copies_of_modes(hypothesis: Hypothesis) -> list[int]:
    """Return the indices of causes whose added mode lies within the bandwidth of a nominal mode and has its shape.

    Two poles closer than their half-power bands, with residues in the same ratio, describe one resonance of another
    form, such as that of a mode whose damping depends on frequency, or one that moves during the recordings. Shapes
    count as the same if they differ by less than the laboratory errors of shapes, ``1 - MAC <= 2 shape^2``; those of
    one response and one excitation always do.
    """
    places = [k for k, cause in enumerate(hypothesis.causes) if isinstance(cause.physics, MissingMode)]
    count, model, tolerance = hypothesis.shape.nominal_modes, hypothesis.model, 2 * hypothesis.shape.lab.shape**2
    halves = model.damping_ratios * model.natural_frequencies
    copies = []
    for place, added in zip(places, range(count, len(model.poles)), strict=True):
        apart = np.abs(model.natural_frequencies[:count] - model.natural_frequencies[added])
        near = np.flatnonzero(apart <= halves[:count] + halves[added])
        if any(_likeness(model, int(mode), added) >= 1 - tolerance for mode in near):
            copies.append(place)
    return copies


def _likeness(model: ModalModel, first: int, second: int) -> float:
    """Return the smaller of the modal assurance criteria of right and of left vectors of two modes, 0 to 1."""
    return min(
        float(np.abs(np.vdot(shapes[first], shapes[second])) ** 2)
        / float(np.vdot(shapes[first], shapes[first]).real * np.vdot(shapes[second], shapes[second]).real)
        for shapes in (model.right, model.left)
    )
