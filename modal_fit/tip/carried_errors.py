"""Errors of in-process modes that hammer FRFs carried to the tip, with what the two tests disagree about."""

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Complex, Real

from ..models.modal_model import ModalModel
from ..models.synthesis import derived_covariance
from .agreement import SensorAgreement, residues_of
from .mapping import real_matrix, real_parts, shapes_at_tip, tip_maps
from .matching import shared_forces


def carried_covariance(
    model: ModalModel, hammer: ModalModel, agreement: SensorAgreement, replaced: NDArray[np.bool_], right: Complex
) -> Real | None:
    """Map the in-process covariance to the tip; add that by the hammer test, and the disagreement of both tests.

    The first two can be added because the measurements are independent.
    """
    if model.covariance is None:
        return None
    chosen, start = agreement.hammer_modes, 2 * len(model.poles)
    block = slice(start, start + 2 * model.right.size)
    through = np.eye(len(model.covariance))
    through[block, block] = real_matrix(tip_maps(hammer, chosen, replaced))
    covariance = through @ model.covariance @ through.T
    by_hammer = derived_covariance(
        hammer, lambda m: real_parts(shapes_at_tip(tip_maps(m, chosen, replaced), model.right))
    )
    if by_hammer is not None:
        covariance[block, block] += by_hammer
    covariance[block, block] += _disagreement(model, hammer, agreement, right)
    rest = slice(block.stop, None)
    expected = np.diag(covariance)[rest].reshape(2, *model.left.shape).sum(axis=(0, 2))
    covariance[rest, rest] += _one_error_of(_left_difference(model, hammer, agreement), expected)
    return np.asarray(covariance)


def _disagreement(model: ModalModel, hammer: ModalModel, agreement: SensorAgreement, right: Complex) -> Real:
    """Return the covariance of the tip's motion by what the tests differ in beyond their errors, mode by mode.

    The other estimate of the motion at the tip is that of the hammer test alone, ``A_T conj(l) / |l|^2`` with the left
    vector l of the cut and the residues A_T scaled by the damped frequencies. The difference of the two is a
    standard error, in the share that the errors do not explain.
    """
    chosen, n = agreement.hammer_modes, right.shape[1]
    shared = shared_forces(model.excitations, hammer.excitations)
    forces = model.left[:, shared.first]
    size = np.sum(np.abs(forces) ** 2, axis=1)[:, None]

    def by_taps(m: ModalModel) -> Complex:
        participation = np.sum(m.left[chosen][:, shared.second] * shared.signs * forces.conj(), axis=1)[:, None] / size
        stiffer = (m.poles.imag[chosen] / model.poles.imag)[:, None]
        return np.asarray(m.right[chosen, :n] * participation * stiffer)

    difference = by_taps(hammer) - right
    # the errors of a factor are those of a real part: the imaginary part has as much
    expected = 2 * agreement.factor_errors**2 * np.sum(np.abs(right) ** 2, axis=1)
    return _one_error_of(difference, expected)


def _left_difference(model: ModalModel, hammer: ModalModel, agreement: SensorAgreement) -> Complex:
    """Return what the left vectors of both tests differ by.

    Those of the hammer test at the sensor are ``conj(r) A / |r|^2`` with the right vector r of the cut. What they
    differ by along the left vector itself is a matter of scale, which the right vectors carry.
    """
    shared = shared_forces(model.excitations, hammer.excitations)
    n = len(hammer.responses) - len(model.responses)
    tapped = residues_of(hammer, shared, first=False, n_tip=n)[agreement.hammer_modes]
    size = np.sum(np.abs(model.right) ** 2, axis=1) * model.poles.imag
    left = model.left[:, shared.first]
    of_taps = np.einsum("rp,rpq->rq", model.right.conj(), tapped) / size[:, None]
    along = np.sum(left.conj() * of_taps, axis=1) / np.maximum(np.sum(np.abs(left) ** 2, axis=1), 1e-300)
    difference = np.zeros_like(model.left)
    difference[:, shared.first] = of_taps - left * along[:, None]
    return difference


def _one_error_of(difference: Complex, expected: Real) -> Real:
    """Return the covariance in which the difference of each mode, of any phase, is one standard error.

    Only the share beyond the variances ``expected`` (n_modes,) counts.
    """
    squared = np.sum(np.abs(difference) ** 2, axis=1)
    share = np.maximum(1 - expected / np.maximum(squared, 1e-300), 0.0)
    total = np.zeros((2 * difference.size,) * 2)
    for r, weight in enumerate(share):
        alone = np.zeros_like(difference)
        alone[r] = difference[r]
        for turned in (alone, 1j * alone):
            total += weight / 2 * np.outer(real_parts(turned), real_parts(turned))
    return total
