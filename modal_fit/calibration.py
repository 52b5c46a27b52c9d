"""Calibration of an in-process model from the sensor to the tool tip, by two hammer FRFs."""

from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from estimation import Frf, FrfCovariance, to_receptance
from millfrf.core import Band, Complex, Index, InputError, MillfrfError, Real, counted, shared_band

from .models.modal_model import ModalModel
from .models.out_of_band import Residuals
from .models.synthesis import FittedModel, derived_covariance
from .polyreference import ModalFit, fit_polyreference
from .settings import SETTINGS
from .shapes import modal_assurance


def sensor_to_tip(tip: Complex, sensor: Complex, replaced: NDArray[np.bool_]) -> Complex:
    """Return one matrix for each mode that maps its motion at the sensor to its motion at the tip.

    The shape is (n_modes, n_directions, n_directions).

    The matrix is diagonal; the entry of each direction is the ratio ``phi_T / phi_S``. Where the sensor hardly moves
    (``replaced``), the ratio is all noise; the motion of the tip is then ``phi_T`` of the hammer test, scaled by the
    whole shape: ``phi_T phi_S^H / |phi_S|^2``. ``tip`` and ``sensor`` (n_modes, n_directions) are shapes of the hammer
    test, of common scale.

    >>> tip, sensor = np.array([[2.0 + 0j, 3.0]]), np.array([[1.0 + 0j, 0.0]])
    >>> sensor_to_tip(tip, sensor, np.array([[False, True]]))[0].real.tolist()
    [[2.0, 0.0], [3.0, 0.0]]
    """
    safe = np.where(np.abs(sensor) > 0, sensor, 1e-300)
    ratio = (tip / safe)[:, :, None] * np.eye(tip.shape[1])
    whole_shape = tip[:, :, None] * sensor.conj()[:, None, :] / np.sum(np.abs(sensor) ** 2, axis=1)[:, None, None]
    return np.asarray(np.where(replaced[:, :, None], whole_shape, ratio))


def shapes_at_tip(maps: Complex, shapes: Complex) -> Complex:
    """Map shapes (n_modes, n_directions) at the sensor to the tip."""
    return np.asarray(np.einsum("rpq,rq->rp", maps, shapes))


def real_matrix(maps: Complex) -> Real:
    """Return one real matrix that maps all shapes, each packed as its real parts and then its imaginary parts."""
    blocks = scipy.linalg.block_diag(*maps)
    return np.block([[blocks.real, -blocks.imag], [blocks.imag, blocks.real]])


@dataclass(frozen=True, eq=False, repr=False)
class TipCalibration(FittedModel):
    """An in-process model mapped to the tool tip.

    Parameters
    ----------
    model
        Calibrated model, with the tip's degrees of freedom as responses.
    ratios : (n_modes, n_directions), complex
        Ratio of each mode's right vector at the tip to that at the sensor: phi_tip / phi_sensor of the hammer test,
        except where the sensor hardly moves.
    ratio_errors : (n_modes, n_directions)
        Standard errors of the ratios (circular), NaN where the hammer FRFs have no covariance, or where the sensor
        hardly moves.
    hammer_modes : (n_modes,), int
        Index of the hammer mode that was used for each in-process mode.
    hammer_fit
        The fit of both hammer FRFs with common poles.
    warnings
        Warnings about the calibration, one sentence each.
    """

    model: ModalModel
    ratios: Complex
    ratio_errors: Real
    hammer_modes: Index
    hammer_fit: ModalFit
    warnings: tuple[str, ...]

    def _note(self) -> str:
        nodes = dict.fromkeys(label.partition(":")[0] for label in self.model.responses)
        return f"ratios of {counted(len(self.ratios), 'mode')} to {', '.join(nodes)}"


def calibrate_to_tip(
    model: ModalModel, tip: Frf, sensor: Frf, *, band: Band | None = None, max_order: int = 30
) -> TipCalibration:
    """Multiply each mode by ``phi_T / phi_S`` (Mohammadi & Ahmadi, Eq. 13-14), direction by direction.

    The spindle assembly moves as a rigid body in the modes of the joints, so tip and sensor share poles and left
    vectors; both hammer FRFs are fitted as one matrix. The ratio is complex, one for each mode and direction: a mode
    with a rotation moves tip and sensor differently. An in-process mode takes the ratio of the hammer mode that is
    nearest in frequency and shape.

    Parameters
    ----------
    model
        In-process model with responses at the sensor.
    tip, sensor
        Hammer FRFs, both excited at the tip: response at the tip and at the sensor, same directions in the
        same order, on the same frequency axis.
    band : Hz
        Band of the hammer fit; None: the range of the model's modes, widened by a quarter on either side.
    max_order
        Highest order of the hammer fit.

    Raises
    ------
    InputError
        Axes or directions that do not match, or a hammer fit without a mode near an in-process one.
    """
    tip, sensor = to_receptance(tip), to_receptance(sensor)
    _check(model, tip, sensor)
    natural = model.natural_frequencies
    span = band or (0.75 * float(natural.min()), 1.25 * float(natural.max()))
    try:
        fit = fit_polyreference(_joined(tip, sensor), span, max_order=max_order)
    except InputError:
        raise
    except MillfrfError as error:
        frequencies = ", ".join(f"{frequency:.4g}" for frequency in natural)
        raise InputError(
            f"no hammer mode near the in-process modes at {frequencies} Hz: {error}; tap the same structure in the "
            "same pose"
        ) from error
    n = len(tip.responses)
    chosen, warnings = _matched(model, fit.model, n)
    replaced = _barely_moving(fit.model, chosen, n)
    right = shapes_at_tip(_maps(fit.model, chosen, replaced), model.right)
    ratios = right / np.where(np.abs(model.right) > 0, model.right, 1e-300)
    warnings += [
        f"mode {r + 1} ({natural[r]:.2f} Hz) hardly moves {sensor.responses[direction]}: the motion of the tip there "
        "is that of the hammer test, scaled by the whole shape"
        for r, direction in np.argwhere(replaced)
    ]
    calibrated = replace(
        model,
        right=right,
        responses=tip.responses,
        residuals=None if model.residuals is None else _scaled(model.residuals, model, ratios),
        covariance=_covariance(model, fit.model, chosen, replaced),
        band=shared_band(model.band, shared_band(tip.band, sensor.band)),
    )
    errors = _ratio_errors(fit.model, chosen, replaced)
    return TipCalibration(calibrated, ratios, errors, chosen, fit, tuple(warnings))


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


def _matched(model: ModalModel, hammer: ModalModel, n: int) -> tuple[Index, list[str]]:
    """Return the hammer mode that is nearest to each in-process mode in log frequency and in shape at the sensor."""
    f, hammer_f = model.natural_frequencies, hammer.natural_frequencies
    assurance = modal_assurance(model.right, hammer.right[:, n:])
    distance = np.abs(np.log(f[:, None] / hammer_f[None, :]))
    # 10 % of frequency count as much as a MAC of 0
    chosen = np.argmin(distance / 0.1 + (1 - assurance), axis=1).astype(np.int64)
    warnings = []
    for r, h in enumerate(chosen):
        if distance[r, h] > SETTINGS.matched_frequency:
            raise InputError(
                f"no hammer mode near the in-process mode at {f[r]:.2f} Hz (nearest {hammer_f[h]:.2f} Hz); widen the "
                "band or tap the same pose"
            )
        if assurance[r, h] < SETTINGS.matched_assurance:
            warnings.append(
                f"mode {r + 1} ({f[r]:.2f} Hz) and its hammer mode ({hammer_f[h]:.2f} Hz) differ in shape: "
                f"MAC {assurance[r, h]:.2f}"
            )
    if len(set(chosen.tolist())) < len(chosen):
        warnings.append("two in-process modes take the ratio of one hammer mode; check the hammer fit")
    return chosen, warnings


def _barely_moving(hammer: ModalModel, chosen: Index, n: int) -> NDArray[np.bool_]:
    """Return in which sensor directions a mode hardly moves: the relative error of the component is above 30 %."""
    shapes = hammer.right[chosen, n:]
    unit = shapes / np.linalg.norm(shapes, axis=1, keepdims=True)

    def normalised(m: ModalModel) -> Real:
        own = m.right[chosen, n:]
        return _real(own / np.sum(unit.conj() * own, axis=1)[:, None])

    covariance = derived_covariance(hammer, normalised)
    if covariance is None:
        return np.zeros(shapes.shape, dtype=bool)
    errors = np.sqrt(np.diag(covariance).reshape(2, *shapes.shape).sum(axis=0) / 2)
    return np.asarray(errors > SETTINGS.uncertain_ratio * np.abs(unit))


def _ratio_errors(hammer: ModalModel, chosen: Index, replaced: NDArray[np.bool_]) -> Real:
    """Return the standard errors of phi_T / phi_S; NaN where the ratio was not used or its error is not known."""
    n = replaced.shape[1]
    covariance = derived_covariance(hammer, lambda m: _real(m.right[chosen, :n] / m.right[chosen, n:]))
    if covariance is None:
        return np.full(replaced.shape, np.nan)
    variance = np.diag(covariance).reshape(2, *replaced.shape)
    return np.where(replaced, np.nan, np.sqrt(variance.sum(axis=0) / 2))


def _real(values: Complex) -> Real:
    return np.concatenate([values.real.ravel(), values.imag.ravel()])


def _maps(hammer: ModalModel, chosen: Index, replaced: NDArray[np.bool_]) -> Complex:
    n = replaced.shape[1]
    return sensor_to_tip(hammer.right[chosen, :n], hammer.right[chosen, n:], replaced)


def _scaled(residuals: Residuals, model: ModalModel, ratios: Complex) -> Residuals:
    """Multiply the residuals of each response by the mean real ratio of the modes, weighted by their motion.

    The hammer test gives no better factor for modes outside the band.
    """
    weight = np.abs(model.right) ** 2
    mean = np.sum(weight * ratios.real, axis=0) / np.sum(weight, axis=0)
    residues = None if residuals.residues is None else residuals.residues * mean[None, :, None]
    return Residuals(residuals.upper * mean[:, None], residuals.lower * mean[:, None], residuals.poles, residues)


def _covariance(model: ModalModel, hammer: ModalModel, chosen: Index, replaced: NDArray[np.bool_]) -> Real | None:
    """Map the in-process covariance to the tip and add the covariance by the hammer test.

    The two can be added because the measurements are independent.
    """
    if model.covariance is None:
        return None
    start = 2 * len(model.poles)
    block = slice(start, start + 2 * model.right.size)
    through = np.eye(len(model.covariance))
    through[block, block] = real_matrix(_maps(hammer, chosen, replaced))
    covariance = through @ model.covariance @ through.T
    by_hammer = derived_covariance(hammer, lambda m: _real(shapes_at_tip(_maps(m, chosen, replaced), model.right)))
    if by_hammer is not None:
        covariance[block, block] += by_hammer
    return np.asarray(covariance)
