"""Calibration of an in-process model from the sensor to the tool tip, by two hammer FRFs."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from estimation import Frf, FrfCovariance, to_receptance
from millfrf.core import Complex, InputError, MillfrfError, Result, Summary, counted, shared_band

from .models.modal_model import ModalModel
from .models.out_of_band import Residuals
from .models.synthesis import derived_covariance, fit_summary
from .polyreference import ModalFit, fit_polyreference
from .shapes import modal_assurance

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def sensor_to_tip(tip: Complex, sensor: Complex, replaced: NDArray[np.bool_]) -> Complex:
    """Give a matrix for each mode that takes its motion at the sensor to that at the tip.

    Direction by direction it is the ratio ``phi_T / phi_S``. Where the sensor hardly moves that ratio says nothing; the
    tip's motion is then ``phi_T`` of the hammer test, scaled by the whole shape: ``phi_T phi_S^H / |phi_S|^2``.

    Parameters
    ----------
    tip, sensor : (n_modes, n_directions), complex
        Shapes of the hammer test, of common scale.
    replaced : (n_modes, n_directions), bool
        Directions in which the sensor hardly moves.

    Returns
    -------
    (n_modes, n_directions, n_directions), complex

    Examples
    --------
    >>> tip, sensor = np.array([[2.0 + 0j, 3.0]]), np.array([[1.0 + 0j, 0.0]])
    >>> sensor_to_tip(tip, sensor, np.array([[False, True]]))[0].real.tolist()
    [[2.0, 0.0], [3.0, 0.0]]
    """
    safe = np.where(np.abs(sensor) > 0, sensor, 1e-300)
    own = (tip / safe)[:, :, None] * np.eye(tip.shape[1])
    whole = tip[:, :, None] * sensor.conj()[:, None, :] / np.sum(np.abs(sensor) ** 2, axis=1)[:, None, None]
    return np.asarray(np.where(replaced[:, :, None], whole, own))


def carried(maps: Complex, shapes: Complex) -> Complex:
    """Shapes (n_modes, n_directions) at the tip."""
    return np.asarray(np.einsum("rpq,rq->rp", maps, shapes))


def as_real(maps: Complex) -> NDArray[np.float64]:
    """One real matrix that carries all shapes, packed as real parts and then imaginary parts."""
    n_modes, n, _ = maps.shape
    whole = np.zeros((n_modes * n, n_modes * n), dtype=complex)
    for r, one in enumerate(maps):
        whole[r * n : (r + 1) * n, r * n : (r + 1) * n] = one
    return np.block([[whole.real, -whole.imag], [whole.imag, whole.real]])


_POOR = 0.3  # relative standard error of the sensor's motion above which a ratio to it says nothing


@dataclass(frozen=True, eq=False, repr=False)
class TipCalibration(Result):
    """An in-process model carried to the tool tip.

    Parameters
    ----------
    model
        Calibrated model, with the tip's degrees of freedom as responses.
    ratios : (n_modes, n_directions), complex
        Ratio of each mode's right vector at the tip to that at the sensor: phi_tip / phi_sensor of the hammer test,
        but where the sensor hardly moves.
    ratio_errors : (n_modes, n_directions)
        Standard errors of the ratios (circular), NaN where the hammer FRFs came without covariance, or where the sensor
        hardly moves.
    hammer_modes : (n_modes,), int
        Index of the hammer mode that served each in-process mode.
    hammer_fit
        The fit of both hammer FRFs with common poles.
    warnings
        Doubts about the calibration, one sentence each.
    """

    model: ModalModel
    ratios: Complex
    ratio_errors: NDArray[np.float64]
    hammer_modes: NDArray[np.int64]
    hammer_fit: ModalFit
    warnings: tuple[str, ...]

    def plot(self, axes: "Axes | None" = None, **choices: Any) -> "Axes":
        """Draw the FRF that the model gives and return the axes; see `draw_model` for the choices."""
        return self.model.plot(axes, **choices)

    def _summary(self) -> Summary:
        nodes = dict.fromkeys(label.partition(":")[0] for label in self.model.responses)
        note = (f"ratios of {counted(len(self.ratios), 'mode')} to {', '.join(nodes)}",)
        return fit_summary("TipCalibration", self.model, note, self.warnings)


def calibrate_to_tip(
    model: ModalModel, tip: Frf, sensor: Frf, *, band: tuple[float, float] | None = None, max_order: int = 30
) -> TipCalibration:
    """Multiply each mode by ``phi_T / phi_S`` (Mohammadi & Ahmadi, Eq. 13-14), direction by direction.

    The spindle assembly moves as a rigid body in the modes of the joints, so tip and sensor share poles and left
    vectors; both hammer FRFs are fitted as one matrix. The ratio is complex, one for each mode and direction: a mode
    that turns moves tip and sensor differently. An in-process mode takes the ratio of the hammer mode that is nearest
    in frequency and shape.

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
        listed = ", ".join(f"{frequency:.4g}" for frequency in natural)
        raise InputError(
            f"no hammer mode near the in-process modes at {listed} Hz: {error}; tap the same structure in the same pose"
        ) from error
    n = len(tip.responses)
    chosen, warnings = _matched(model, fit.model, n)
    tip_side, sensor_side = fit.model.right[chosen, :n], fit.model.right[chosen, n:]
    replaced = _badly_seen(fit.model, chosen, n)
    right = carried(sensor_to_tip(tip_side, sensor_side, replaced), model.right)
    ratios = right / np.where(np.abs(model.right) > 0, model.right, 1e-300)
    warnings += [
        f"mode {r + 1} ({natural[r]:.2f} Hz) hardly moves {sensor.responses[direction]}: the motion of the tip there "
        "is that of the hammer test, scaled by the whole shape"
        for r, direction in np.argwhere(replaced)
    ]
    covariance = _covariance(model, fit.model, chosen, replaced)
    residuals = None if model.residuals is None else _scaled(model.residuals, model, ratios)
    calibrated = replace(
        model,
        right=right,
        responses=tip.responses,
        residuals=residuals,
        covariance=covariance,
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
            f"tip directions {directions[0]} and sensor directions {directions[1]} differ; order them alike"
        )
    if tip.excitations != sensor.excitations:
        raise InputError(
            f"tip FRF excited at {', '.join(tip.excitations)}, sensor FRF at {', '.join(sensor.excitations)}; "
            "tap one point"
        )
    if tip.frequencies.shape != sensor.frequencies.shape or not np.allclose(tip.frequencies, sensor.frequencies):
        raise InputError("tip and sensor FRF have different frequency axes; estimate both with the same segments")


def _joined(tip: Frf, sensor: Frf) -> Frf:
    """Tip rows above sensor rows; covariance of the rows kept apart."""
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
        None,
        covariance,
        exponential_time_constant=tip.exponential_time_constant,
    )


def _matched(model: ModalModel, hammer: ModalModel, n: int) -> tuple[NDArray[np.int64], list[str]]:
    """Hammer mode for each in-process mode, by distance in log frequency and 1 - MAC of the sensor shape."""
    likeness = modal_assurance(model.right, hammer.right[:, n:])
    distance = np.abs(np.log(model.natural_frequencies[:, None] / hammer.natural_frequencies[None, :]))
    chosen = np.argmin(distance / 0.1 + (1 - likeness), axis=1).astype(np.int64)
    warnings = []
    for r, h in enumerate(chosen):
        if distance[r, h] > 0.25:
            raise InputError(
                f"no hammer mode near the in-process mode at {model.natural_frequencies[r]:.2f} Hz (nearest "
                f"{hammer.natural_frequencies[h]:.2f} Hz); widen the band or tap the same pose"
            )
        if likeness[r, h] < 0.8:
            warnings.append(
                f"mode {r + 1} ({model.natural_frequencies[r]:.2f} Hz) and its hammer mode "
                f"({hammer.natural_frequencies[h]:.2f} Hz) differ in shape: MAC {likeness[r, h]:.2f}"
            )
    if len(set(chosen.tolist())) < len(chosen):
        warnings.append("two in-process modes take the ratio of one hammer mode; check the hammer fit")
    return chosen, warnings


def _badly_seen(hammer: ModalModel, chosen: NDArray[np.int64], n: int) -> NDArray[np.bool_]:
    """Sensor directions in which a mode hardly moves: the error of its share in the shape is over 30 % of it."""
    shapes = hammer.right[chosen, n:]
    unit = shapes / np.linalg.norm(shapes, axis=1, keepdims=True)

    def share(m: ModalModel) -> NDArray[np.float64]:
        own = m.right[chosen, n:]
        return _real(own / np.sum(unit.conj() * own, axis=1)[:, None])

    spread = derived_covariance(hammer, share)
    if spread is None:
        return np.zeros(shapes.shape, dtype=bool)
    errors = np.sqrt(np.diag(spread).reshape(2, *shapes.shape).sum(axis=0) / 2)
    return np.asarray(errors > _POOR * np.abs(unit))


def _ratio_errors(hammer: ModalModel, chosen: NDArray[np.int64], replaced: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Standard errors of phi_T / phi_S; NaN where the ratio was not used, or where they are not known."""
    n = replaced.shape[1]
    spread = derived_covariance(hammer, lambda m: _real(m.right[chosen, :n] / m.right[chosen, n:]))
    if spread is None:
        return np.full(replaced.shape, np.nan)
    variance = np.diag(spread).reshape(2, *replaced.shape)
    return np.where(replaced, np.nan, np.sqrt(variance.sum(axis=0) / 2))


def _real(values: Complex) -> NDArray[np.float64]:
    return np.concatenate([values.real.ravel(), values.imag.ravel()])


def _scaled(residuals: Residuals, model: ModalModel, ratios: Complex) -> Residuals:
    """Residual rows scaled by the modes' mean real ratio, weighted by how much each moves: no better is known there."""
    weight = np.abs(model.right) ** 2
    mean = np.sum(weight * ratios.real, axis=0) / np.sum(weight, axis=0)
    residues = None if residuals.residues is None else residuals.residues * mean[None, :, None]
    return Residuals(residuals.upper * mean[:, None], residuals.lower * mean[:, None], residuals.poles, residues)


def _covariance(
    model: ModalModel, hammer: ModalModel, chosen: NDArray[np.int64], replaced: NDArray[np.bool_]
) -> NDArray[np.float64] | None:
    """Carry the in-process covariance to the tip and add the hammer test's own: the measurements are independent."""
    if model.covariance is None:
        return None
    n = replaced.shape[1]
    start = 2 * len(model.poles)
    through = np.eye(len(model.covariance))
    block = slice(start, start + 2 * model.right.size)
    through[block, block] = as_real(sensor_to_tip(hammer.right[chosen, :n], hammer.right[chosen, n:], replaced))
    covariance = through @ model.covariance @ through.T
    spread = derived_covariance(
        hammer,
        lambda m: _real(carried(sensor_to_tip(m.right[chosen, :n], m.right[chosen, n:], replaced), model.right)),
    )
    if spread is not None:
        covariance[block, block] += spread
    return np.asarray(covariance)
