"""A receptance measured in one posture, with whitening factors for its errors: of an FRF, or of a modal model."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimation import Frf, to_receptance
from millfrf.core import HOUSING, TIP, Complex, InputError, Real
from modal_fit import ModalModel, pack_parameters, unpack_parameters

from ..settings import UPDATE


@dataclass(frozen=True)
class PosedReceptance:
    """Receptance that was measured in one posture.

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
        Indices of responses and excitations in (TIP, HOUSING).
    values : (n_lines, n_responses, n_excitations), m/N
        Receptance as it was measured in this posture.
    left, right
        Factors that whiten each line, ``left @ error @ right``: (n_lines, p, p) and (n_lines, q, q).
    projection : (n_known, 2 n_lines p q) or None
        For a modal model, the matrix that whitens real and imaginary parts of all lines together; left and right are
        empty then.
    window : (n_taps,) or None
        Weights by which a windowed estimate averages the FRF over half lines about each line; None: it does not.
    half_line : Hz
        Half the distance of the estimate's lines.
    sensor : (3,), m, or None
        Housing sensor from the tip, in the channels' axes.
    independent : float
        Share of the lines that are independent: neighbouring lines of a windowed estimate have the same noise.
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
        """Return the frequencies at which the model is computed, Hz; with a window, half lines are included."""
        if self.window is None:
            return self.frequencies
        taps = self.half_line * (np.arange(len(self.window)) - len(self.window) // 2)
        return np.asarray(np.maximum(self.frequencies[:, None] + taps, 1e-3).ravel())

    def as_measured(self, model: Complex) -> Complex:
        """Average model values on :attr:`lines` as the windowed estimate of the FRF does, (..., n_lines, p, q)."""
        if self.window is None:
            return model
        taps = model.reshape(*model.shape[:-3], len(self.frequencies), len(self.window), *model.shape[-2:])
        return np.asarray(np.tensordot(taps, self.window, axes=(-3, 0)))

    def whitened(self, error: Complex) -> Real:
        """Convert errors (..., n_lines, p, q) to n real numbers of unit variance, (..., n)."""
        if self.projection is not None:
            flat = error.reshape(*error.shape[:-3], -1)
            return np.asarray(np.concatenate([flat.real, flat.imag], axis=-1) @ self.projection.T)
        white = self.left @ error @ self.right
        flat = np.sqrt(2 * self.independent) * white.reshape(*error.shape[:-3], -1)
        return np.asarray(np.concatenate([flat.real, flat.imag], axis=-1))

    @property
    def count(self) -> float:
        """Return the number of independent real numbers that were measured."""
        if self.projection is not None:
            return float(len(self.projection))
        return 2 * self.independent * float(self.values.size)

    def selected(self, lines: NDArray[np.bool_]) -> "PosedReceptance":
        """Select some lines of an FRF; a modal model is refused, because all its lines are whitened together."""
        return replace(
            self,
            frequencies=self.frequencies[lines],
            values=self.values[lines],
            left=self.left[lines],
            right=self.right[lines],
        )


def _indices(labels: tuple[str, ...], name: str, what: str) -> tuple[int, ...]:
    """Return the indices of labels in the list of TIP and HOUSING directions; refuse unknown labels."""
    known = (*TIP, *HOUSING) if what == "responses" else TIP
    unknown = [label for label in labels if label not in known]
    if unknown:
        raise InputError(
            f"{name}: {what} at {', '.join(unknown)}; a robot's model gives {', '.join(known)}: rename them or leave "
            "them out"
        )
    return tuple(known.index(label) for label in labels)


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
    """Prepare an FRF as a measurement, whitened by its covariance, its coherence, or the scatter of its lines.

    At most 120 lines are compared, at equal steps: neighbouring lines of a finer estimate are nearly the same.

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
        The same as in :class:`PosedReceptance`.

    Raises
    ------
    InputError
        A transfer, unknown degrees of freedom, or fewer than 10 lines in the band.
    """
    if frf.quantity == "transfer":
        raise InputError(f"{name}: a transfer in {frf.unit} does not give a robot's stiffness; give a receptance")
    if frf.exponential_time_constant is not None:
        raise InputError(f"{name}: an exponential window adds damping to this FRF; fit it, and give the modal model")
    receptance = to_receptance(frf)
    in_band = receptance.valid & (receptance.frequencies >= band[0]) & (receptance.frequencies <= band[1])
    if in_band.sum() < 10:
        raise InputError(
            f"{name}: {in_band.sum()} valid lines from {band[0]:g} to {band[1]:g} Hz; 10 are needed: widen --band"
        )
    chosen = np.flatnonzero(in_band)
    chosen = chosen[:: -(-len(chosen) // 120)]
    left, right = _whiteners(receptance, chosen)
    return PosedReceptance(
        name,
        np.asarray(q, dtype=float),
        np.eye(3) if axes is None else np.asarray(axes, dtype=float),
        receptance.frequencies[chosen],
        _indices(receptance.responses, name, "responses"),
        _indices(receptance.excitations, name, "excitations"),
        receptance.values[chosen],
        left,
        right,
        window=window,
        half_line=float(np.diff(receptance.frequencies).min()) / 2,
        sensor=sensor,
    )


def _whiteners(frf: Frf, chosen: NDArray[np.int64]) -> tuple[Complex, Complex]:
    """Compute inverse Cholesky factors of the errors' covariance of rows and of columns, with the least error added."""
    values = frf.values[chosen]
    size = np.sqrt(np.mean(np.abs(values) ** 2, axis=(1, 2)))
    least = UPDATE.least_line_error * size
    p, q = values.shape[1:]
    if frf.covariance is not None:
        response = _smoothed(frf.covariance.response)[chosen]
        excitation = frf.covariance.excitation[chosen]
        scale = np.einsum("kqq->k", excitation).real / q
        level = response * scale[:, None, None] + least[:, None, None] ** 2 * np.eye(p)
        unit = excitation / np.maximum(scale, 1e-300)[:, None, None]
        return _inverse_root(level), _inverse_root(unit).transpose(0, 2, 1)
    stated = frf.entry_variance()
    variance = None if stated is None else stated[chosen]
    if variance is None or not np.isfinite(variance).all():
        variance = _scatter(values)
    level = np.sqrt(variance.mean(axis=2) + least[:, None] ** 2)
    left = np.eye(p) / level[:, :, None]
    return left.astype(complex), np.broadcast_to(np.eye(q, dtype=complex), (len(values), q, q))


def _smoothed(covariance: Complex) -> Complex:
    """Average the covariance over up to 20 lines on either side.

    A covariance from few averages makes whitened errors seem larger: with nu averages and p responses, the squared
    errors grow by ``nu / (nu - p)`` (Hotelling 1931).
    """
    half = min(20, (len(covariance) - 1) // 8)
    if half < 1:
        return covariance
    flat = np.pad(covariance.reshape(len(covariance), -1), ((half, half), (0, 0)), mode="edge")
    sums = np.cumsum(np.vstack([np.zeros((1, flat.shape[1])), flat]), axis=0)
    return np.asarray((sums[2 * half + 1 :] - sums[: -2 * half - 1]) / (2 * half + 1)).reshape(covariance.shape)


def _inverse_root(matrices: Complex) -> Complex:
    """Compute ``L^-1`` of the Cholesky factors ``A = L L^H`` of several matrices A."""
    p = matrices.shape[-1]
    size = np.einsum("kpp->k", matrices).real / p
    # a matrix that is only semi-definite gets a little more on its diagonal
    positive = matrices + 1e-9 * size[:, None, None] * np.eye(p)
    return np.asarray(np.linalg.inv(np.linalg.cholesky(positive)))


def _scatter(values: Complex) -> Real:
    """Estimate the variance of each entry from third differences of neighbouring lines, smoothed, (n_lines, p, q)."""
    if len(values) < 12:
        return (0.02 * np.abs(values)) ** 2
    # white noise of variance 1 has third differences of variance 1 + 9 + 9 + 1
    third = np.abs(np.diff(values, 3, axis=0)) ** 2 / 20.0
    half = max(4, len(values) // 40)
    kernel = np.ones(2 * half + 1) / (2 * half + 1)
    flat = np.pad(third.reshape(len(third), -1), ((2 + half, 1 + half), (0, 0)), mode="edge")
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
    """Prepare a modal model as a measurement: its receptance on lines around its poles, whitened by its covariance.

    ``cov(H) = J C J^T`` has as many directions as the model has parameters; other directions were not measured.

    Parameters
    ----------
    model
        Modal model of a receptance, with its covariance; without one, errors of 0.2 % in frequency, 5 % in damping and
        3 % in shapes are assumed.
    name, q, band, axes, sensor
        The same as in :func:`measured_frf`; the model's own band narrows it.

    Raises
    ------
    InputError
        A transfer, unknown degrees of freedom, or no mode in the band.
    """
    if model.quantity != "receptance":
        raise InputError(f"{name}: a modal model of a {model.quantity}; give one of a receptance")
    low, high = (max(band[0], model.band[0]), min(band[1], model.band[1])) if model.band else band
    natural = model.natural_frequencies
    near = np.flatnonzero((natural >= low) & (natural <= high))
    if not len(near):
        raise InputError(f"{name}: no mode from {low:g} to {high:g} Hz; move --band")
    # 24 lines about each pole, over three half-power half-widths on either side
    widths = -model.poles.real[near] / (2 * np.pi)
    lines = (natural[near][:, None] + 3 * widths[:, None] * np.linspace(-1, 1, 24)).ravel()
    frequencies = np.unique(np.clip(lines, low, high))
    values = model.receptance(frequencies)
    return PosedReceptance(
        name,
        np.asarray(q, dtype=float),
        np.eye(3) if axes is None else np.asarray(axes, dtype=float),
        frequencies,
        _indices(model.responses, name, "responses"),
        _indices(model.excitations, name, "excitations"),
        values,
        np.zeros((0, 0, 0), dtype=complex),
        np.zeros((0, 0, 0), dtype=complex),
        projection=_projection(model, frequencies, values, len(near)),
        sensor=sensor,
    )


def _projection(model: ModalModel, frequencies: Real, values: Complex, n_modes: int) -> Real:
    """Compute the whitening matrix of a model's receptance from the covariance and derivatives of its parameters."""
    packed = pack_parameters(model)
    covariance = model.covariance if model.covariance is not None else np.diag(_assumed_errors(model) ** 2)
    steps = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    slopes = np.zeros((2 * values.size, len(packed)))
    for i in np.flatnonzero(steps > 0):
        moved = packed.copy()
        moved[i] += 1e-3 * steps[i]
        change = (unpack_parameters(model, moved).receptance(frequencies) - values).ravel() / (1e-3 * steps[i])
        slopes[:, i] = np.concatenate([change.real, change.imag])
    # eigenvectors of the correlations, because the numbers differ in unit and size
    squares, vectors = np.linalg.eigh(covariance / np.outer(steps + 1e-300, steps + 1e-300))
    root = slopes @ (steps[:, None] * vectors * np.sqrt(np.maximum(squares, 0.0)))
    u, s, _ = np.linalg.svd(root, full_matrices=False)
    count = n_modes * 2 * (1 + len(model.responses) + len(model.excitations) - 1)
    known = np.flatnonzero(s > 1e-6 * s[0])[:count]
    size = np.abs(values).ravel()
    floor = (2 * UPDATE.least_line_error * np.concatenate([size, size]))[:, None] * u[:, known]
    variance = s[known] ** 2 + np.sum(floor**2, axis=0)
    return np.asarray((u[:, known] / np.sqrt(variance)).T)


def _assumed_errors(model: ModalModel) -> Real:
    """Return assumed standard errors of a model without covariance, in the order of `modal_fit.pack_parameters`."""
    errors = [0.05 * np.abs(model.poles.real), 0.002 * np.abs(model.poles)]
    for vectors in (model.right, model.left):
        level = 0.03 * np.sqrt(np.mean(np.abs(vectors) ** 2, axis=1, keepdims=True)) * np.ones(vectors.shape)
        errors += [level.ravel(), level.ravel()]
    return np.concatenate(errors)
