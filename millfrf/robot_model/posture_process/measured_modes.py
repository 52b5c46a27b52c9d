"""`MeasuredModes`: modes measured in one posture, paired with computed ones."""

from dataclasses import dataclass

import numpy as np
import scipy

from millfrf.core import TIP, DegreeOfFreedom, InputError, Real
from modal_fit import ModalModel, derived_covariance

FLOORS = (1e-3, 0.03, 0.03)
"""Least relative standard error of a measured frequency, damping ratio and shape: fits are more certain than posture,
temperature and clamping are."""

UNKNOWN = (3e-3, 0.1, 0.1)
"""The same where a modal model has no covariance."""


@dataclass(frozen=True)
class MeasuredModes:
    """Modes measured in one posture.

    Parameters
    ----------
    name
        Name of the measurement.
    driven : (n_active,), rad or m
        Driven joint values.
    frequencies : (n_modes,), Hz
        Undamped natural frequencies.
    damping : (n_modes,)
        Damping ratios of the measured modes.
    shapes : (n_modes, n_directions), kg^-1/2
        Mass-normalised motion of the tip along the measured directions, its sign free.
    errors : (n_modes, 3)
        Relative standard errors of frequency, damping ratio and shape.
    directions : (n_directions, 3)
        Unit vectors of the measured directions of the tip, in the base frame.
    """

    name: str
    driven: Real
    frequencies: Real
    damping: Real
    shapes: Real
    errors: Real
    directions: Real


def measured_modes(name: str, driven: Real, model: ModalModel, axes: Real | None = None) -> MeasuredModes:
    """Take frequencies, damping and mass-normalised tip motion out of a measured modal model.

    ``R = 2 i w_d A`` of a mode with residue A is ``phi phi^T`` where damping is light; ``phi`` is the largest
    eigenvector of its real symmetric part.

    Parameters
    ----------
    name
        Name of the measurement.
    driven : (n_active,), rad or m
        Driven joint values of the posture.
    model
        Receptance with at least one direction of the tip both excited and measured.
    axes : (3, 3) or None
        X, Y, Z of the model as columns, in the base frame; None: the base frame.

    Raises
    ------
    InputError
        Another quantity, no direction of the tip that is both excited and measured, or a mode that is not damped.
    """
    if model.quantity != "receptance":
        raise InputError(f"{name}: a model of {model.quantity}; learning needs a receptance at the tool tip")
    rows, columns = _tip_places(model.responses), _tip_places(model.excitations)
    shared = [axis for axis in rows if axis in columns]
    if not shared:
        raise InputError(
            f"{name}: no direction of the tip ({', '.join(TIP)}) is both measured and excited; measure a driving point"
        )
    if not len(model.poles) or model.poles.real.max() >= 0:
        raise InputError(f"{name}: the model has no modes, or one that does not decay; fit it again")
    axes = np.eye(3) if axes is None else np.asarray(axes, dtype=float)
    places = _Places(rows, {axis: columns[axis] for axis in shared})
    return MeasuredModes(
        name,
        np.asarray(driven, dtype=float),
        model.natural_frequencies,
        model.damping_ratios,
        _shapes(model, places),
        _errors(model, places),
        axes[:, sorted(rows)].T,
    )


@dataclass(frozen=True)
class _Places:
    """Index and sign of each direction of the tip among responses (all measured) and excitations (those shared)."""

    rows: dict[int, tuple[int, float]]
    columns: dict[int, tuple[int, float]]


def _tip_places(labels: tuple[str, ...]) -> dict[int, tuple[int, float]]:
    node = TIP[0].partition(":")[0]
    found: dict[int, tuple[int, float]] = {}
    for index, label in enumerate(labels):
        dof = DegreeOfFreedom.parse(label)
        if dof.node == node and dof.direction[1:] in ("X", "Y", "Z"):
            found.setdefault("XYZ".index(dof.direction[1:]), (index, dof.sign))
    return found


def _shapes(model: ModalModel, places: _Places) -> Real:
    """Motion along all measured directions, (n_modes, n_directions)."""
    rows, columns = sorted(places.rows), sorted(places.columns)
    right = np.stack([model.right[:, places.rows[axis][0]] * places.rows[axis][1] for axis in rows], axis=1)
    left = np.stack([model.left[:, places.columns[axis][0]] * places.columns[axis][1] for axis in columns], axis=1)
    whole = np.real(2j * model.poles.imag[:, None, None] * right[:, :, None] * left[:, None, :])
    driving = [rows.index(axis) for axis in columns]
    square = whole[:, driving]
    values, vectors = np.linalg.eigh((square + square.transpose(0, 2, 1)) / 2)
    size = np.sqrt(np.maximum(values[:, -1], 0.0))
    shapes = np.einsum("rpq,rq->rp", whole, vectors[:, :, -1]) / np.maximum(size, 1e-12)[:, None]
    shapes[:, driving] = vectors[:, :, -1] * size[:, None]
    return np.asarray(shapes)


def _errors(model: ModalModel, places: _Places) -> Real:
    """Relative standard errors with floors, (n_modes, 3)."""
    errors = np.tile(UNKNOWN, (len(model.poles), 1))
    shapes = _shapes(model, places)
    size = np.maximum(np.linalg.norm(shapes, axis=1), 1e-12)
    covariance = derived_covariance(model, lambda one: _signed(_shapes(one, places), shapes).ravel())
    if covariance is not None:
        spread = np.diag(covariance).reshape(shapes.shape)
        errors[:, 2] = np.sqrt(np.maximum(spread.mean(axis=1), 0.0)) / size
    known = model.standard_errors()
    if known is not None:
        errors[:, 0] = known[0] / model.natural_frequencies
        errors[:, 1] = known[1] / model.damping_ratios
    return np.asarray(np.maximum(errors, FLOORS))


def _signed(shapes: Real, reference: Real) -> Real:
    turned = np.sum(shapes * reference, axis=1) < 0
    return np.asarray(np.where(turned[:, None], -shapes, shapes))


AT_FIRST, KNOWN = (0.12, 0.35), (0.05, 0.3)
"""Differences that weigh the same, of the logarithm of frequency and of the tip's motion as a share of it: of a model
as it is, and of one that was corrected."""

FARTHEST = 0.5
"""Logarithm of a ratio of frequencies beyond which two modes are never the same."""


def mode_pairs(
    frequencies: Real, shapes: Real, computed: Real, moved: Real, scales: tuple[float, float] = AT_FIRST
) -> tuple[tuple[int, int], ...]:
    """Pair measured modes with computed ones at the least total distance.

    ``(log f / g)^2 / a^2 + min |phi -+ psi|^2 / (b^2 |phi| |psi|)``, with a and b of ``scales``.

    Parameters
    ----------
    frequencies : (n_measured,), Hz
        Measured natural frequencies.
    shapes : (n_measured, n_directions)
        Measured motion of the tip.
    computed : (n_computed,), Hz
        Computed natural frequencies.
    moved : (n_computed, n_directions)
        Computed motion of the tip along the same directions.
    scales
        Differences of frequency and of shape that weigh the same.

    Returns
    -------
    Pairs (measured, computed) in the order of the measured modes; modes farther apart than ``FARTHEST`` have none.

    Examples
    --------
    >>> turned = np.eye(2)[::-1]
    >>> mode_pairs(np.array([10.0, 10.5]), np.eye(2), np.array([10.2, 10.3]), turned)
    ((0, 1), (1, 0))
    """
    ratio = np.log(frequencies)[:, None] - np.log(computed)[None, :]
    first, second = np.linalg.norm(shapes, axis=1), np.linalg.norm(moved, axis=1)
    both = np.maximum(np.outer(first, second), 1e-30)
    apart = (first[:, None] ** 2 + second[None, :] ** 2 - 2 * np.abs(shapes @ moved.T)) / both
    cost = (ratio / scales[0]) ** 2 + np.minimum(apart, 4.0) / scales[1] ** 2
    cost[np.abs(ratio) > FARTHEST] = 1e4
    rows, columns = scipy.optimize.linear_sum_assignment(cost)
    return tuple((int(i), int(j)) for i, j in zip(rows, columns, strict=True) if cost[i, j] < 1e4)
