"""A receptance measured in one posture, with what whitens its errors: of an FRF, or of a modal model."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimation import Frf, to_receptance
from millfrf.core import HOUSING, TIP, Complex, InputError, Real
from modal_fit import ModalModel, pack_parameters, unpack_parameters

LABELS = (*TIP, *HOUSING)

FINEST = 1e-3
"""Least error of a line that is believed, as a share of the size of its matrix: calibration, linearity, posture."""

LINES_A_MODE = 24
"""Lines about each pole on which a modal model is compared."""

MOST_LINES = 120
"""Lines that are compared at most: neighbours of a finer estimate tell nearly the same."""

SMOOTHED = 20
"""Lines on either side over which the covariance of the responses is averaged."""

FITTED_ERRORS = (0.002, 0.05, 0.03)
"""Errors of frequency, damping and shapes, as shares, where a modal model states none."""


@dataclass(frozen=True)
class PosedReceptance:
    """What was measured in one posture.

    Parameters
    ----------
    name
        Name of the file.
    q : (n_moving,), rad or m
        Joint values as stated.
    axes : (3, 3)
        Columns: X, Y, Z of the channels in the base frame.
    frequencies : (n_lines,), Hz
        Lines that are compared.
    rows, columns
        Places of responses and excitations in TIP and HOUSING.
    values : (n_lines, n_responses, n_excitations), m/N
        Receptance as it was measured in this posture.
    left, right
        Factors that whiten each line, ``left @ error @ right``: (n_lines, p, p) and (n_lines, q, q).
    projection : (n_known, 2 n_lines p q) or None
        For a modal model, what whitens real and imaginary parts of all lines together; then left and right are empty.
    window : (n_taps,) or None
        Weights by which a windowed estimate averages the FRF over half lines about each line; None: it does not.
    half_line : Hz
        Half the distance of the estimate's lines.
    sensor : (3,), m, or None
        Housing sensor from the tip, in the channels' axes.
    independent : float
        Share of the lines that are independent: neighbours of a windowed estimate tell the same noise.
    """

    name: str
    q: Real
    axes: Real
    frequencies: Real
    rows: tuple[int, ...]
    columns: tuple[int, ...]
    values: Complex
    left: Complex
    right: Complex
    projection: Real | None = None
    window: Real | None = None
    half_line: float = 0.0
    sensor: Real | None = None
    independent: float = 1.0

    @property
    def lines(self) -> Real:
        """Frequencies at which the model is asked, Hz: half lines too where a window averages over them."""
        if self.window is None:
            return self.frequencies
        taps = self.half_line * (np.arange(len(self.window)) - len(self.window) // 2)
        return np.asarray(np.maximum(self.frequencies[:, None] + taps, 1e-3).ravel())

    def as_measured(self, model: Complex) -> Complex:
        """The model's values on :attr:`lines` as this measurement shows them, (..., n_lines, p, q)."""
        if self.window is None:
            return model
        taps = model.reshape(*model.shape[:-3], len(self.frequencies), len(self.window), *model.shape[-2:])
        return np.asarray(np.tensordot(taps, self.window, axes=(-3, 0)))

    def whitened(self, error: Complex) -> Real:
        """Errors (..., n_lines, p, q) as real numbers of unit variance, (..., n)."""
        if self.projection is not None:
            flat = error.reshape(*error.shape[:-3], -1)
            return np.asarray(np.concatenate([flat.real, flat.imag], axis=-1) @ self.projection.T)
        whole = self.left @ error @ self.right
        flat = np.sqrt(2 * self.independent) * whole.reshape(*error.shape[:-3], -1)
        return np.asarray(np.concatenate([flat.real, flat.imag], axis=-1))

    @property
    def count(self) -> float:
        """Independent real numbers that were measured."""
        if self.projection is not None:
            return float(len(self.projection))
        return 2 * self.independent * float(self.values.size)

    def part(self, kept: NDArray[np.bool_]) -> "PosedReceptance":
        """Some of the lines of an FRF."""
        if self.projection is not None:
            raise InputError(f"{self.name}: the lines of a modal model tell one thing together and cannot be parted")
        return replace(
            self,
            frequencies=self.frequencies[kept],
            values=self.values[kept],
            left=self.left[kept],
            right=self.right[kept],
        )


def places_of(labels: tuple[str, ...], name: str, what: str) -> tuple[int, ...]:
    """Places of labels in TIP and HOUSING.

    Raises
    ------
    InputError
        A label that a robot's model does not give.
    """
    known = LABELS if what == "responses" else TIP
    strange = [label for label in labels if label not in known]
    if strange:
        raise InputError(
            f"{name}: {what} at {', '.join(strange)}; a robot's model gives {', '.join(known)}: rename or leave out"
        )
    return tuple(LABELS.index(label) for label in labels)


def measured_frf(
    frf: Frf,
    name: str,
    q: Real,
    band: tuple[float, float],
    *,
    axes: Real | None = None,
    sensor: Real | None = None,
    window: Real | None = None,
) -> PosedReceptance:
    """An FRF as a measurement; its covariance whitens it, or its coherence, or the scatter of neighbouring lines.

    Parameters
    ----------
    frf
        Receptance, mobility or accelerance at the tip, or at the housing, for forces at the tip.
    name
        Name of the file.
    q : (n_moving,), rad or m
        Joint values of the posture.
    band
        Lowest and highest frequency that are compared, Hz.
    axes, sensor, window
        As in :class:`PosedReceptance`.

    Raises
    ------
    InputError
        A transfer, strange degrees of freedom, or fewer than 10 lines in the band.
    """
    if frf.quantity == "transfer":
        raise InputError(f"{name}: a transfer in {frf.unit} says nothing of a robot's stiffness; give a receptance")
    if frf.exponential_time_constant is not None:
        raise InputError(f"{name}: an exponential window damps this FRF; fit it, and give the modal model instead")
    found = to_receptance(frf)
    kept = found.valid & (found.frequencies >= band[0]) & (found.frequencies <= band[1])
    if kept.sum() < 10:
        raise InputError(f"{name}: {kept.sum()} valid lines from {band[0]:g} to {band[1]:g} Hz; 10 are the least")
    spacing = float(np.diff(found.frequencies).min())
    places = np.flatnonzero(kept)
    kept = np.zeros_like(kept)
    kept[places[:: -(-len(places) // MOST_LINES)]] = True
    left, right = _whiteners(found, kept)
    values = found.values[kept]
    return PosedReceptance(
        name,
        np.asarray(q, dtype=float),
        np.eye(3) if axes is None else np.asarray(axes, dtype=float),
        found.frequencies[kept],
        places_of(found.responses, name, "responses"),
        places_of(found.excitations, name, "excitations"),
        values,
        left,
        right,
        window=window,
        half_line=spacing / 2,
        sensor=sensor,
    )


def _whiteners(frf: Frf, kept: NDArray[np.bool_]) -> tuple[Complex, Complex]:
    """Inverse Cholesky factors of the errors' covariance on each line, with the finest error that is believed."""
    values = frf.values[kept]
    size = np.sqrt(np.mean(np.abs(values) ** 2, axis=(1, 2)))
    p, q = values.shape[1:]
    if frf.covariance is not None:
        response = _smoothed(frf.covariance.response)[kept]
        excitation = frf.covariance.excitation[kept]
        scale = np.einsum("kqq->k", excitation).real / q
        level = response * scale[:, None, None] + (FINEST * size)[:, None, None] ** 2 * np.eye(p)
        unit = excitation / np.maximum(scale, 1e-300)[:, None, None]
        return _inverse_root(level), _inverse_root(unit).transpose(0, 2, 1)
    variance = frf.entry_variance()
    known = None if variance is None else variance[kept]
    if known is None or not np.isfinite(known).all():
        known = _scatter(values)
    level = np.sqrt(known.mean(axis=2) + (FINEST * size)[:, None] ** 2)
    left = np.eye(p) / level[:, :, None]
    return left.astype(complex), np.broadcast_to(np.eye(q, dtype=complex), (len(values), q, q))


def _smoothed(covariance: Complex) -> Complex:
    """Mean over neighbouring lines: whitening by a covariance of few averages makes every error seem larger.

    With nu averages and p responses the squared errors grow by ``nu / (nu - p)`` (Hotelling 1931).
    """
    half = min(SMOOTHED, (len(covariance) - 1) // 8)
    if half < 1:
        return covariance
    flat = np.pad(covariance.reshape(len(covariance), -1), ((half, half), (0, 0)), mode="edge")
    whole = np.cumsum(np.vstack([np.zeros((1, flat.shape[1])), flat]), axis=0)
    return np.asarray((whole[2 * half + 1 :] - whole[: -2 * half - 1]) / (2 * half + 1)).reshape(covariance.shape)


def _inverse_root(matrices: Complex) -> Complex:
    """``L^-1`` of ``A = L L^H``; a matrix that is not positive gets a little more on its diagonal."""
    p = matrices.shape[-1]
    size = np.einsum("kpp->k", matrices).real / p
    held = matrices + 1e-9 * size[:, None, None] * np.eye(p)
    return np.asarray(np.linalg.inv(np.linalg.cholesky(held)))


def _scatter(values: Complex) -> Real:
    """Variance of each entry from third differences of neighbouring lines, smoothed over lines (n_lines, p, q)."""
    if len(values) < 12:
        return (0.02 * np.abs(values)) ** 2
    third = np.abs(np.diff(values, 3, axis=0)) ** 2 / 20.0
    padded = np.concatenate([third[:1], third[:1], third, third[-1:]])
    half = max(4, len(values) // 40)
    kernel = np.ones(2 * half + 1) / (2 * half + 1)
    flat = np.pad(padded.reshape(len(padded), -1), ((half, half), (0, 0)), mode="edge")
    smooth = np.stack([np.convolve(column, kernel, mode="valid") for column in flat.T], axis=1)
    return smooth.reshape(values.shape)


def measured_model(
    model: ModalModel,
    name: str,
    q: Real,
    band: tuple[float, float],
    *,
    axes: Real | None = None,
    sensor: Real | None = None,
) -> PosedReceptance:
    """A modal model as a measurement: its receptance on lines about its poles, whitened by its own covariance.

    ``cov(H) = J C J^T`` has as many directions as the model has numbers; what lies outside of them was not measured.

    Parameters
    ----------
    model
        Modal model of a receptance; its covariance, else 0.2 % in frequency, 5 % in damping and 3 % in shapes.
    name, q, band, axes, sensor
        As in :func:`measured_frf`; the model's own band narrows it.

    Raises
    ------
    InputError
        A transfer, strange degrees of freedom, or no mode in the band.
    """
    if model.quantity != "receptance":
        raise InputError(f"{name}: a modal model of a {model.quantity}; give one of a receptance")
    low, high = (max(band[0], model.band[0]), min(band[1], model.band[1])) if model.band else band
    natural = model.natural_frequencies
    near = np.flatnonzero((natural >= low) & (natural <= high))
    if not len(near):
        raise InputError(f"{name}: no mode from {low:g} to {high:g} Hz; move --band")
    frequencies = _lines_about(model, near, low, high)
    values = model.receptance(frequencies)
    return PosedReceptance(
        name,
        np.asarray(q, dtype=float),
        np.eye(3) if axes is None else np.asarray(axes, dtype=float),
        frequencies,
        places_of(model.responses, name, "responses"),
        places_of(model.excitations, name, "excitations"),
        values,
        np.zeros((0, 0, 0), dtype=complex),
        np.zeros((0, 0, 0), dtype=complex),
        projection=_projection(model, frequencies, values, near),
        sensor=sensor,
    )


def _lines_about(model: ModalModel, near: NDArray[np.int64], low: float, high: float) -> Real:
    spread = np.linspace(-1, 1, LINES_A_MODE)
    widths = -model.poles.real[near] / (2 * np.pi)
    lines = (model.natural_frequencies[near][:, None] + 3 * widths[:, None] * spread).ravel()
    return np.unique(np.clip(lines, low, high))


def _projection(model: ModalModel, frequencies: Real, values: Complex, near: NDArray[np.int64]) -> Real:
    packed = pack_parameters(model)
    covariance = model.covariance if model.covariance is not None else _assumed(model, packed)
    steps = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    free = np.flatnonzero(steps > 0)
    slopes = np.zeros((2 * values.size, len(packed)))
    for i in free:
        moved = packed.copy()
        moved[i] += 1e-3 * steps[i]
        change = (unpack_parameters(model, moved).receptance(frequencies) - values).ravel() / (1e-3 * steps[i])
        slopes[:, i] = np.concatenate([change.real, change.imag])
    values_, vectors = np.linalg.eigh(covariance / np.outer(steps + 1e-300, steps + 1e-300))
    root = slopes @ (steps[:, None] * vectors * np.sqrt(np.maximum(values_, 0.0)))
    u, s, _ = np.linalg.svd(root, full_matrices=False)
    known = len(near) * 2 * (1 + len(model.responses) + len(model.excitations) - 1)
    kept = np.flatnonzero(s > 1e-6 * s[0])[:known]
    size = np.abs(values).ravel()
    floor = (2 * FINEST * np.concatenate([size, size]))[:, None] * u[:, kept]
    variance = s[kept] ** 2 + np.sum(floor**2, axis=0)
    return np.asarray((u[:, kept] / np.sqrt(variance)).T)


def _assumed(model: ModalModel, packed: Real) -> Real:
    """Diagonal covariance of a model that states none."""
    n = len(model.poles)
    frequency, damping, shape = FITTED_ERRORS
    size = np.abs(model.poles)
    errors = [damping * np.abs(model.poles.real), frequency * size]
    for vectors in (model.right, model.left):
        level = shape * np.sqrt(np.mean(np.abs(vectors) ** 2, axis=1, keepdims=True)) * np.ones(vectors.shape)
        errors += [level.ravel(), level.ravel()]
    found = np.concatenate(errors)
    if len(found) != len(packed):
        raise InputError(f"modal model of {n} modes: {len(packed)} numbers, {len(found)} errors")
    return np.diag(found**2)
