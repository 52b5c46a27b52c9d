"""Agreement of in-process and hammer residues at the sensor, mode by mode and channel by channel."""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import Complex, Index, InputError, Real

from ..models.modal_model import ModalModel
from ..models.synthesis import derived_covariance
from ..settings import SETTINGS
from ..shapes import modal_assurance
from .mapping import real_parts
from .matching import SharedForces, assign, scaled_residues, shared_forces


@dataclass(frozen=True)
class SensorAgreement:
    """In-process modes and the hammer modes that they are, compared at the sensor.

    A factor is ``c = <A_hammer, A_process> / <A_hammer, A_hammer>``, where A is a residue times its damped frequency,
    so that a stiffer structure alone does not change it: 1 for equal scale, sign and phase.

    Parameters
    ----------
    hammer_modes : (n_modes,), int
        Index of the hammer mode of each in-process mode; none appears twice.
    frequencies, damping : (n_modes, 2)
        Natural frequencies (Hz) and damping ratios, in the cut and by hammer.
    frequency_errors, damping_errors : (n_modes, 2)
        Standard errors of both; NaN where they are not known.
    assurance, assurance_errors : (n_modes,)
        MAC of the residue matrices, 0 to 1, and its standard errors from both covariances; 0 where not known.
    factors, response_factors, force_factors : (n_modes,), (n_responses,), (n_shared,), complex
        Factor of each mode, of each response over all modes, and of each force over all modes.
    factor_errors, response_factor_errors, force_factor_errors
        Standard errors of their real parts, from the scatter of the entries and from both covariances.
    responses, forces
        Names of the responses, and of the forces that both tests have.
    """

    hammer_modes: Index
    frequencies: Real
    damping: Real
    frequency_errors: Real
    damping_errors: Real
    assurance: Real
    assurance_errors: Real
    factors: Complex
    response_factors: Complex
    force_factors: Complex
    factor_errors: Real
    response_factor_errors: Real
    force_factor_errors: Real
    responses: tuple[str, ...]
    forces: tuple[str, ...]

    @property
    def agrees(self) -> NDArray[np.bool_]:
        """Return which modes agree in shape, scale and sign within their errors, (n_modes,)."""
        return agreeing(self.assurance, self.factors, self.assurance_errors, self.factor_errors)


def sensor_agreement(model: ModalModel, hammer: ModalModel, n_tip: int) -> SensorAgreement:
    """Assign the hammer modes and compare their residues at the sensor with those of the in-process model.

    Parameters
    ----------
    model
        In-process model with responses at the sensor.
    hammer
        Model of both hammer FRFs, the rows of the tip first.
    n_tip
        Number of responses at the tip.

    Raises
    ------
    InputError
        No direction of force in common, fewer hammer modes than in-process modes, or a mode without a partner.
    """
    shared = shared_forces(model.excitations, hammer.excitations)
    process, tapped = residues_of(model, shared, first=True), residues_of(hammer, shared, first=False, n_tip=n_tip)
    f, hammer_f = model.natural_frequencies, hammer.natural_frequencies
    if len(hammer_f) < len(f):
        raise InputError(
            f"the hammer FRFs show {len(hammer_f)} modes ({_listed(hammer_f)} Hz), the in-process model has {len(f)} "
            f"({_listed(f)} Hz): tap so that the missing modes move, or fit the model with --modes {len(hammer_f)}"
        )
    _, chosen = assign((f, hammer_f), (process, tapped))
    _refuse_distant(f, hammer_f, chosen)
    pair = (process, tapped[chosen])
    values = _factors(*pair)
    places = np.cumsum([len(factors) for factors in values])[:-1]
    known = _variances(model, hammer, chosen, shared, n_tip)
    errors = np.sqrt(np.maximum(known[len(f) :], _scatter(*pair)) + _noise_share(hammer, chosen, shared, n_tip) ** 2)
    of_modes, of_responses, of_forces = np.split(errors, places)
    both = [(model, np.arange(len(f))), (hammer, chosen)]
    spread = [_mode_errors(m)[:, rows] for m, rows in both]
    return SensorAgreement(
        chosen,
        np.column_stack([m.natural_frequencies[rows] for m, rows in both]),
        np.column_stack([m.damping_ratios[rows] for m, rows in both]),
        np.column_stack([errors_of[0] for errors_of in spread]),
        np.column_stack([errors_of[1] for errors_of in spread]),
        assurance_of(*pair),
        np.sqrt(known[: len(f)]),
        *values,
        of_modes,
        of_responses,
        of_forces,
        model.responses,
        shared.names,
    )


def without_partner(model: ModalModel, hammer: ModalModel, n_tip: int) -> Index:
    """Return the in-process modes that have no hammer mode of like shape near them, one to one."""
    shared = shared_forces(model.excitations, hammer.excitations)
    process, tapped = residues_of(model, shared, first=True), residues_of(hammer, shared, first=False, n_tip=n_tip)
    f, hammer_f = model.natural_frequencies, hammer.natural_frequencies
    rows, chosen = assign((f, hammer_f), (process, tapped))
    alike = assurance_of(process[rows], tapped[chosen]) >= SETTINGS.matched_assurance
    near = np.abs(np.log(f[rows] / hammer_f[chosen])) <= SETTINGS.matched_frequency
    return np.setdiff1d(np.arange(len(f)), rows[alike & near])


def residues_of(model: ModalModel, shared: SharedForces, *, first: bool, n_tip: int = 0) -> Complex:
    """Return the scaled residues at the rows from ``n_tip`` on, for the shared forces of the first or second model."""
    rows = np.arange(n_tip, len(model.responses))
    columns, signs = (shared.first, 1.0) if first else (shared.second, shared.signs)
    return scaled_residues(model, rows, columns, signs)


def assurance_of(process: Complex, tapped: Complex) -> Real:
    """Return the MAC of each residue matrix with its partner, (n_modes,)."""
    return np.diag(modal_assurance(process.reshape(len(process), -1), tapped.reshape(len(tapped), -1))).copy()


def agreeing(assurance: Real, factors: Complex, assurance_errors: Real, factor_errors: Real) -> NDArray[np.bool_]:
    """Return which modes agree in shape, and in scale and sign within a factor of two, within their errors.

    A one-sided test of each: the deviation beyond the limit over its standard error, against the p-value that counts
    as significant. With an error above 1, the factor of equal tests, a mode is not comparable, and has to be within
    the limits itself.

    Examples
    --------
    >>> mac, factors = np.array([0.79, 0.79, 1.0]), np.array([1.0, 1.0, 2.3]) + 0j
    >>> agreeing(mac, factors, np.array([0.012, 0.001, 0.0]), np.array([0.1, 0.1, 0.1])).tolist()
    [True, False, False]
    """
    least, largest = SETTINGS.matched_factor
    margin = np.where(factor_errors <= 1, scipy.special.ndtri(1 - SETTINGS.significance), 0.0)
    factor_errors = np.minimum(factor_errors, 1.0)
    return np.asarray(
        (assurance + margin * assurance_errors >= SETTINGS.matched_assurance)
        & (factors.real + margin * factor_errors >= least)
        & (np.abs(factors) - margin * factor_errors <= largest)
    )


def _factors(process: Complex, tapped: Complex) -> tuple[Complex, Complex, Complex]:
    """Return the factors of modes, responses and forces of residues (n_modes, n_responses, n_forces)."""
    product, size = tapped.conj() * process, np.abs(tapped) ** 2

    def over(axes: tuple[int, int]) -> Complex:
        total = size.sum(axis=axes)
        return np.asarray(product.sum(axis=axes) / np.where(total > 0, total, np.inf))

    return over((1, 2)), over((0, 2)), over((0, 1))


def _variances(model: ModalModel, hammer: ModalModel, chosen: Index, shared: SharedForces, n_tip: int) -> Real:
    """Return variances of the assurance of each mode and of the real parts of all factors, by both covariances."""
    process = residues_of(model, shared, first=True)
    tapped = residues_of(hammer, shared, first=False, n_tip=n_tip)[chosen]

    def compared(cut: Complex, taps: Complex) -> Real:
        return np.concatenate([assurance_of(cut, taps), np.concatenate(_factors(cut, taps)).real])

    by_cut = derived_covariance(model, lambda m: compared(residues_of(m, shared, first=True), tapped))
    by_hammer = derived_covariance(
        hammer, lambda m: compared(process, residues_of(m, shared, first=False, n_tip=n_tip)[chosen])
    )
    known = [np.diag(covariance) for covariance in (by_cut, by_hammer) if covariance is not None]
    return sum(known, np.zeros_like(compared(process, tapped)))


def _noise_share(hammer: ModalModel, chosen: Index, shared: SharedForces, n_tip: int) -> Real:
    """Return the share of noise in the power of the hammer residues behind each factor: it pulls the factor to zero.

    Infinite where nothing moves.
    """

    def residues(m: ModalModel) -> Complex:
        return residues_of(m, shared, first=False, n_tip=n_tip)[chosen]

    tapped = residues(hammer)
    covariance = derived_covariance(hammer, lambda m: real_parts(residues(m)))
    noise = np.zeros(tapped.shape) if covariance is None else np.diag(covariance).reshape(2, *tapped.shape).sum(axis=0)
    shares = []
    for axes in ((1, 2), (0, 2), (0, 1)):
        power = np.sum(np.abs(tapped) ** 2, axis=axes)
        known = power > SETTINGS.rounding_power * power.max()
        shares.append(np.divide(noise.sum(axis=axes), power, out=np.full(len(power), np.inf), where=known))
    return np.concatenate(shares)


def _scatter(process: Complex, tapped: Complex) -> Real:
    """Return variances of the factors' real parts from the entries that one factor does not explain."""
    variances = []
    for factors, axes in zip(_factors(process, tapped), ((1, 2), (0, 2), (0, 1)), strict=True):
        rest = process - np.expand_dims(factors, axes) * tapped
        size = np.sum(np.abs(tapped) ** 2, axis=axes)
        freedom = max(int(np.prod([process.shape[axis] for axis in axes])) - 1, 1)
        variances.append(np.sum(np.abs(rest) ** 2, axis=axes) / (2 * freedom * np.where(size > 0, size, np.inf)))
    return np.concatenate(variances)


def _mode_errors(model: ModalModel) -> Real:
    errors = model.standard_errors()
    return np.full((2, len(model.poles)), np.nan) if errors is None else np.stack(errors)


def _refuse_distant(f: Real, hammer_f: Real, chosen: Index) -> None:
    distance = np.abs(np.log(f / hammer_f[chosen]))
    worst = int(distance.argmax())
    if distance[worst] > SETTINGS.matched_frequency:
        raise InputError(
            f"no hammer mode near the in-process mode at {f[worst]:.2f} Hz: one to one, {hammer_f[chosen[worst]]:.2f} "
            f"Hz is left for it (hammer modes at {_listed(hammer_f)} Hz); tap the same structure in the same pose"
        )


def _listed(frequencies: Real) -> str:
    return ", ".join(f"{f:.4g}" for f in frequencies)
