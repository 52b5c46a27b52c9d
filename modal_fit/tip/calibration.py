"""Calibration of an in-process model from the sensor to the tool tip, by two hammer FRFs."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimation import Frf, FrfCovariance, shared_points, to_receptance
from millfrf.core import Band, Complex, Index, InputError, MillfrfError, Real, counted

from ..models.modal_model import BandSource, ModalModel
from ..models.out_of_band import Residuals
from ..models.synthesis import FittedModel
from ..polyreference import ModalFit, fit_picked_poles, fit_polyreference
from ..settings import SETTINGS
from .agreement import SensorAgreement, sensor_agreement, without_partner
from .carried_errors import carried_covariance
from .close_pairs import with_pairs_as_in_cut
from .hybrid import TappedBand, hybrid_model, tapped_band
from .mapping import barely_moving, ratio_errors, shapes_at_tip, tip_maps
from .matching import shared_forces
from .mistakes import refuse_disagreement, refuse_exchanged_tip, refuse_tip_scale
from .mode_sets import chosen_modes
from .tapped import at_tip, beyond_taps, static_flexibility
from .untapped import ForceColumns, force_columns, residuals_with_untapped, with_untapped_forces


@dataclass(frozen=True, eq=False, repr=False)
class TipCalibration(FittedModel):
    """An in-process model mapped to the tool tip, with tapped modes where the cut showed none.

    Parameters
    ----------
    model
        Calibrated model, with the tip's degrees of freedom as responses; ``sources`` states which measurement each
        band comes from, ``unmeasured_flexibility`` bounds what neither measurement shows.
    ratios : (n_modes, n_directions), complex
        Ratio of each in-process mode's right vector at the tip to that at the sensor: phi_tip / phi_sensor of the
        hammer test, except where the sensor hardly moves.
    ratio_errors : (n_modes, n_directions)
        Standard errors of the ratios (circular), NaN where the hammer FRFs have no covariance, or where the sensor
        hardly moves.
    agreement
        Comparison of both tests at the sensor, mode by mode.
    hammer_fit
        The fit of both hammer FRFs with common poles.
    warnings
        Warnings about the calibration, one sentence each.
    """

    model: ModalModel
    ratios: Complex
    ratio_errors: Real
    agreement: SensorAgreement
    hammer_fit: ModalFit
    warnings: tuple[str, ...]

    @property
    def hammer_modes(self) -> Index:
        """Return the index of the hammer mode of each in-process mode, (n_modes,)."""
        return self.agreement.hammer_modes

    def _note(self) -> str:
        nodes = dict.fromkeys(label.partition(":")[0] for label in self.model.responses)
        tapped = self.model.mode_sources.count("tapped")
        return f"ratios of {counted(len(self.ratios), 'mode')} to {', '.join(nodes)}; {counted(tapped, 'mode')} of taps"


def calibrate_to_tip(
    model: ModalModel,
    tip: Frf,
    sensor: Frf,
    *,
    band: Band | None = None,
    max_order: int | None = None,
    tip_above: float | None = None,
) -> TipCalibration:
    """Multiply each mode by ``phi_T / phi_S`` (Mohammadi & Ahmadi, Eq. 13-14), direction by direction.

    The spindle assembly moves as a rigid body in the modes of the joints, so tip and sensor share poles and left
    vectors; both hammer FRFs are fitted together. The ratio is complex, one for each mode and direction: a mode
    with a rotation moves tip and sensor differently. Hammer modes are assigned one to one, by frequency and by the
    residues that both tests have at the sensor; these must agree in shape, scale and sign. What they differ by within a
    factor of two counts as a standard error of the tip's motion.

    Modes that only the taps show are added, changed as the common modes change from rest to cut.

    Parameters
    ----------
    model
        In-process model with responses at the sensor.
    tip, sensor
        Hammer FRFs, both excited at the tip: response at the tip and at the sensor, same directions in the
        same order, on the same frequency axis.
    band : Hz
        Band of the hammer fit; None: all usable lines, up to ten times the highest frequency of the model's band.
    max_order
        Highest order of the hammer fit; None: from the number of lines.
    tip_above : Hz
        Frequency above which the modes are those of the taps; None: the upper end of the model's band.

    Raises
    ------
    InputError
        Axes or directions that do not match, modes without a partner, or two tests that disagree.
    """
    if tip.quantity != sensor.quantity:
        tip, sensor = to_receptance(tip), to_receptance(sensor)
    _check(model, tip, sensor)
    complete = set(shared_forces(model.excitations, tip.excitations).names) == set(model.excitations)
    if complete:
        tip, sensor = (_with_forces_of(model, frf) for frf in (tip, sensor))
    columns = force_columns(model.excitations, tip.excitations, tip.responses)
    taps = tapped_band(model, tip, sensor, band, tip_above, complete=columns.known)
    model = chosen_modes(model, np.flatnonzero(model.natural_frequencies <= taps.seam))
    n = len(tip.responses)
    fit, agreement = _hammer_fit(model, _joined(tip, sensor), taps.fitted, max_order)
    hammer = with_pairs_as_in_cut(model, fit.model, n)
    refuse_disagreement(model, hammer, n, agreement)
    _refuse_wrong_tip(hammer, tip, agreement)
    carried, ratios, replaced = _carried(model, hammer, agreement, tip.responses)
    given = _Given(to_receptance(tip), fit, agreement, taps, columns)
    calibrated, warnings = _completed(model, carried, ratios, given, replaced)
    natural = model.natural_frequencies
    resting = [
        f"mode {r + 1} ({natural[r]:.2f} Hz) hardly moves {sensor.responses[direction]}: the motion of the tip there "
        "is that of the hammer test, scaled by the whole shape"
        for r, direction in np.argwhere(replaced)
    ]
    errors = ratio_errors(hammer, agreement.hammer_modes, replaced)
    return TipCalibration(calibrated, ratios, errors, agreement, fit, (*taps.warnings, *resting, *warnings))


@dataclass(frozen=True)
class _Given:
    """FRF of the tip, fit of both hammer FRFs, its agreement with the cut, bands, and the forces that were tapped."""

    tip: Frf
    fit: ModalFit
    agreement: SensorAgreement
    taps: TappedBand
    columns: ForceColumns


def _completed(
    model: ModalModel, carried: ModalModel, ratios: Complex, given: _Given, replaced: NDArray[np.bool_]
) -> tuple[ModalModel, tuple[str, ...]]:
    """Add what only the taps show: their modes, the residuals, and the bound of the rest; return warnings."""
    hammer, taps, columns = given.fit.model, given.taps, given.columns
    warnings: tuple[str, ...] = ()
    tip_modes = at_tip(hammer, given.tip.responses)
    beyond = beyond_taps(given.tip, tip_modes, given.fit.band)
    carried = replace(carried, unmeasured_flexibility=beyond.flexibility_bound)
    if not taps.extends:
        free = np.setdiff1d(np.arange(len(hammer.poles)), given.agreement.hammer_modes)
        bound = beyond.flexibility_bound + static_flexibility(chosen_modes(tip_modes, free))
        residuals = None if model.residuals is None else _scaled(model.residuals, model, ratios)
        sources = () if model.band is None or taps.in_process is None else (BandSource(*taps.in_process, "in-process"),)
        carried = replace(carried, unmeasured_flexibility=bound)
        return replace(carried, residuals=residuals, band=taps.in_process, sources=sources), ()
    residuals = beyond.residuals
    if columns.untapped:
        hammer, share = with_untapped_forces(hammer, columns, carried)
        residuals = residuals_with_untapped(residuals, columns)
        warnings = (
            f"{', '.join(columns.untapped)} was not tapped: outside the band of the cut its force moves the tip as "
            f"reciprocity demands, which the modes of the cut obey to {100 * share:.2g} %; that error is included",
        )

    def right_by_hammer(tapped: ModalModel) -> Complex:
        return shapes_at_tip(tip_maps(tapped, given.agreement.hammer_modes, replaced), model.right)

    tip_modes = at_tip(hammer, given.tip.responses)
    hybrid, more = hybrid_model(carried, hammer, tip_modes, given.agreement, taps, residuals, right_by_hammer)
    return hybrid, (*warnings, *more)


def _check(model: ModalModel, tip: Frf, sensor: Frf) -> None:
    if sensor.responses != model.responses:
        raise InputError(
            f"the sensor FRF has responses {', '.join(sensor.responses)}, the model {', '.join(model.responses)}; "
            "measure both at the same sensor, in the same order"
        )
    directions = [[dof.partition(":")[2] for dof in frf.responses] for frf in (tip, sensor)]
    if directions[0] != directions[1]:
        raise InputError(
            f"tip directions {directions[0]} and sensor directions {directions[1]} differ; use the same order"
        )
    if tip.excitations != sensor.excitations:
        raise InputError(
            f"tip FRF excited at {', '.join(tip.excitations)}, sensor FRF at {', '.join(sensor.excitations)}; "
            "tap one point"
        )
    if tip.frequencies.shape != sensor.frequencies.shape or not np.allclose(tip.frequencies, sensor.frequencies):
        raise InputError("tip and sensor FRF have different frequency axes; estimate both with the same segments")
    if tip.common_errors is not None or sensor.common_errors is not None:
        raise InputError("an FRF with errors that all lines share was computed, not tapped; give FRFs of the same taps")


def _with_forces_of(model: ModalModel, frf: Frf) -> Frf:
    """Return the columns of an FRF in the order and with the signs of the model's forces."""
    shared = shared_forces(model.excitations, frf.excitations)
    order = np.argsort(shared.first)
    columns, signs = shared.second[order], shared.signs[order]
    covariance = frf.covariance
    if covariance is not None:
        excitation = covariance.excitation[:, columns][:, :, columns] * np.outer(signs, signs)
        covariance = FrfCovariance(covariance.response, excitation)
    return replace(
        frf,
        values=frf.values[:, :, columns] * signs,
        excitations=model.excitations,
        covariance=covariance,
        coherence=None if frf.coherence is None else frf.coherence[:, :, columns],
        averages=None if frf.averages is None else frf.averages[:, columns],
    )


def _joined(tip: Frf, sensor: Frf) -> Frf:
    """Stack the rows of the tip FRF above those of the sensor FRF.

    The two tests are independent, so that their noise has no common covariance.
    """
    covariance = None
    if tip.covariance is not None and sensor.covariance is not None:
        n, m = len(tip.responses), len(sensor.responses)
        response = np.zeros((len(tip.frequencies), n + m, n + m), dtype=complex)
        response[:, :n, :n] = tip.covariance.response
        response[:, n:, n:] = sensor.covariance.response
        covariance = FrfCovariance(response, tip.covariance.excitation)
    return Frf(
        tip.frequencies,
        np.concatenate([tip.values, sensor.values], axis=1),
        (*tip.responses, *sensor.responses),
        tip.excitations,
        tip.quantity,
        tip.unit,
        tip.valid & sensor.valid,
        covariance=covariance,
        exponential_time_constant=tip.exponential_time_constant,
    )


def _hammer_fit(model: ModalModel, joined: Frf, band: Band, max_order: int | None) -> tuple[ModalFit, SensorAgreement]:
    """Fit both hammer FRFs; in-process modes that this fit does not show are looked for where the cut has them."""
    n = len(joined.responses) - len(model.responses)
    fit = _automatic_fit(model, joined, band, max_order)

    def missing_in(trial: ModalFit) -> Index:
        return without_partner(model, with_pairs_as_in_cut(model, trial.model, n), n)

    missing = missing_in(fit)
    if len(missing):
        further = [_fit_from(joined, band, poles, max_order) for poles in _further_poles(model, fit.model, missing)]
        whole = [trial for trial in further if trial is not None and not len(missing_in(trial))]
        least = min((float(np.mean(trial.relative_error)) for trial in whole), default=0.0)
        close = [trial for trial in whole if np.mean(trial.relative_error) <= SETTINGS.terms_misfit * least]
        fit = min(close, key=lambda trial: len(trial.model.poles), default=fit)
    return fit, sensor_agreement(model, with_pairs_as_in_cut(model, fit.model, n), n)


def _further_poles(model: ModalModel, hammer: ModalModel, missing: Index) -> tuple[Complex, Complex]:
    """Return poles of the hammer fit with those missing, and with those of the cut in place of all in its span."""
    f, hammer_f = model.natural_frequencies, hammer.natural_frequencies
    low, high = SETTINGS.span_of_matches
    outside = (hammer_f < low * f.min()) | (hammer_f > high * f.max())
    return (
        np.concatenate([hammer.poles, model.poles[missing]]),
        np.concatenate([hammer.poles[outside], model.poles]),
    )


def _fit_from(joined: Frf, band: Band, poles: Complex, max_order: int | None) -> ModalFit | None:
    """Refine the poles on the hammer FRFs; None where some fall together."""
    try:
        return fit_picked_poles(joined, band, poles, refine=True, max_order=max_order)
    except InputError:
        return None


def _automatic_fit(model: ModalModel, joined: Frf, band: Band, max_order: int | None) -> ModalFit:
    try:
        return fit_polyreference(joined, band, max_order=max_order)
    except InputError:
        raise
    except MillfrfError as error:
        frequencies = ", ".join(f"{frequency:.4g}" for frequency in model.natural_frequencies)
        raise InputError(
            f"no hammer mode near the in-process modes at {frequencies} Hz: {error}; tap the same structure in the "
            "same pose"
        ) from error


def _refuse_wrong_tip(hammer: ModalModel, tip: Frf, agreement: SensorAgreement) -> None:
    """Refuse an FRF of the tip with another scale, sign or order of axes than that of the sensor."""
    chosen, n = agreement.hammer_modes, len(tip.responses)
    right, frequencies = hammer.right[chosen], hammer.natural_frequencies[chosen]
    refuse_tip_scale(right[:, :n], right[:, n:], tip.responses, frequencies)
    points = shared_points(tip.responses, hammer.excitations)
    shapes = right[:, [point.row for point in points]] * [point.response_sign for point in points]
    forces = hammer.left[chosen][:, [point.column for point in points]] * [point.excitation_sign for point in points]
    refuse_exchanged_tip(shapes, forces, [tip.responses[point.row] for point in points], frequencies)


def _carried(
    model: ModalModel, hammer: ModalModel, agreement: SensorAgreement, responses: tuple[str, ...]
) -> tuple[ModalModel, Complex, NDArray[np.bool_]]:
    """Return the in-process modes at the tip, their ratios, and where the sensor hardly moves."""
    n, chosen = len(responses), agreement.hammer_modes
    replaced = barely_moving(model, hammer, chosen, n)
    right = shapes_at_tip(tip_maps(hammer, chosen, replaced), model.right)
    ratios = right / np.where(np.abs(model.right) > 0, model.right, 1e-300)
    covariance = carried_covariance(model, hammer, agreement, replaced, right)
    return replace(model, right=right, responses=responses, covariance=covariance, residuals=None), ratios, replaced


def _scaled(residuals: Residuals, model: ModalModel, ratios: Complex) -> Residuals:
    """Multiply the residuals of each response by the mean real ratio of the modes, weighted by their motion.

    The hammer test gives no better factor for modes outside the band.
    """
    weight = np.abs(model.right) ** 2
    mean = np.sum(weight * ratios.real, axis=0) / np.sum(weight, axis=0)
    residues = None if residuals.residues is None else residuals.residues * mean[None, :, None]
    return Residuals(residuals.upper * mean[:, None], residuals.lower * mean[:, None], residuals.poles, residues)
