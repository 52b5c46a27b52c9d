"""Errors that all lines of an FRF share, carried to the modes."""

from dataclasses import replace

import numpy as np

from estimation import Frf
from millfrf.core import Complex, Real

from ..models.modal_model import ModalModel
from ..models.synthesis import pack_parameters
from ..settings import SETTINGS
from .assembly import modal_model
from .elimination import Modes
from .measured_lines import MeasuredLines
from .refinement import refine


def with_common_errors(model: ModalModel, frf: Frf, modes: Modes, lines: MeasuredLines) -> ModalModel:
    """Add the errors that all lines of an FRF share to a model's covariance and standard errors.

    The modes are refined anew to the FRF plus and minus a small part of each error, so that the change is linear even
    where an error moves a resonance by more than its width: in the band poles move by at most a small share of their
    decay rates. As noise that is independent from line to line such errors would average out over the lines of a
    resonance.

    Parameters
    ----------
    model
        Model with errors from the noise, or without any, which is returned unchanged.
    frf
        Fitted FRF.
    modes, lines
        Modes of the model and the lines that they were fitted to.
    """
    if frf.common_errors is None or model.covariance is None or model.errors is None:
        return model
    chosen = np.isin(frf.laplace, lines.s)
    packed, poles = [], []
    for error in frf.common_errors[:, chosen]:
        if not error.any():
            continue
        change = np.einsum("kpq,kjq,up->kju", error, lines.drive, lines.whitening, optimize=True)
        part = min(1.0, SETTINGS.small_change * float(np.linalg.norm(lines.values) / np.linalg.norm(change)))
        ends = _refined_ends(model, frf, modes, lines, part * change)
        while (shift := _largest_shift(*ends, lines)) > SETTINGS.small_shift:
            part *= SETTINGS.small_shift / (2 * shift)
            ends = _refined_ends(model, frf, modes, lines, part * change)
        packed.append((pack_parameters(ends[0]) - pack_parameters(ends[1])) / (2 * part))
        poles.append((_by_mode(ends[0]) - _by_mode(ends[1])) / (2 * part))
    shifts = np.array(packed).reshape(-1, len(model.covariance))
    by_mode = np.sum(np.array(poles).reshape(-1, len(model.poles), 2) ** 2, axis=0)
    errors = replace(model.errors, noise=np.sqrt(model.errors.noise**2 + by_mode))
    return replace(model, covariance=model.covariance + shifts.T @ shifts, errors=errors)


def _refined_ends(
    model: ModalModel, frf: Frf, modes: Modes, lines: MeasuredLines, change: Complex
) -> tuple[ModalModel, ModalModel]:
    """Refine the modes to the lines plus and minus a change."""
    ends = []
    for moved in (replace(lines, values=lines.values + change), replace(lines, values=lines.values - change)):
        refined = refine(modes, moved, SETTINGS.final_effort)
        ends.append(_in_order_of(model, modal_model(frf, refined.modes, refined.elimination, moved)))
    return ends[0], ends[1]


def _largest_shift(above: ModalModel, below: ModalModel, lines: MeasuredLines) -> float:
    """Return half the largest distance between the poles of two models in the band, over their decay rates."""
    low, high = lines.band
    inside = (above.natural_frequencies >= low) & (above.natural_frequencies <= high)
    shifts = np.abs(above.poles - below.poles) / np.abs(above.poles.real + below.poles.real)
    return float(shifts[inside].max(initial=0.0))


def _in_order_of(model: ModalModel, other: ModalModel) -> ModalModel:
    """Return the modes of ``other`` in the order of the nearest poles of ``model``."""
    distance = np.abs(model.poles[:, None] - other.poles[None, :])
    order = np.zeros(len(model.poles), dtype=int)
    for _ in order:
        first, second = np.unravel_index(int(np.argmin(distance)), distance.shape)
        order[first] = second
        distance[first], distance[:, second] = np.inf, np.inf
    return replace(other, poles=other.poles[order], right=other.right[order], left=other.left[order])


def _by_mode(model: ModalModel) -> Real:
    """Return natural frequency (Hz) and damping ratio of each mode, (n_modes, 2)."""
    return np.column_stack([model.natural_frequencies, model.damping_ratios])
