"""Prediction of modal models, with confidence bands, in postures without measurements."""

from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import TIP, Real
from modal_fit import ModalModel, Residuals, pack_parameters

from ..settings import POSTURES
from .learning import LearnedPostures
from .modal_basis import CorrectedModes, ModalBasis, PosturePlace, basis_at, corrected_modes, modelled_damping
from .process import (
    Evidence,
    Rows,
    SquaredDistances,
    covariance,
    discrepancy_rows,
    joined,
    joint_kernels,
    measured_covariance,
    squared_distances,
    unknown_rows,
)


@dataclass(frozen=True)
class Conditioned:
    """The process with one set of hyperparameters, conditioned on the measurements."""

    hyper: Real  # logarithms of the hyperparameters
    evidence: Evidence
    root: Real  # lower Cholesky factor of the measured rows' covariance
    weights: Real  # that covariance's inverse times the measured values

    def predict(self, rows: Rows, cross: SquaredDistances, within: SquaredDistances) -> tuple[Real, Real]:
        """Predict the mean (n,) and the covariance (n, n) of rows, with scatter.

        ``cross`` are the squared distances of the rows' postures to the measured postures, ``within`` those among the
        rows' postures.
        """
        to_measured = covariance(self.hyper, rows, self.evidence.rows, cross)
        prior = covariance(self.hyper, rows, rows, within, same=True)
        reduced = scipy.linalg.solve_triangular(self.root, to_measured.T, lower=True)
        return to_measured @ self.weights, prior - reduced.T @ reduced


def conditioned(evidence: Evidence, hyper: Real) -> Conditioned:
    """Condition the process on the measured rows; their covariance is factored once for all predictions."""
    factor = scipy.linalg.cho_factor(measured_covariance(hyper, evidence), lower=True)
    return Conditioned(hyper, evidence, np.tril(factor[0]), scipy.linalg.cho_solve(factor, evidence.rows.value))


def distances_to(learned: LearnedPostures, place: PosturePlace) -> tuple[SquaredDistances, SquaredDistances]:
    """Compute the squared distances of a new posture to the measured postures, and to itself (zero)."""
    return (
        squared_distances(learned.metric, [place], list(learned.places)),
        squared_distances(learned.metric, [place], [place]),
    )


def _remaining_variance(learned: LearnedPostures, energy: Real, cross: SquaredDistances) -> float:
    """Compute the share of the variance over postures that exact measurements would leave in a new posture.

    It is ``1 - k^T (K + 0.02 I)^-1 k`` with the kernel of each elastic part, averaged over the parts with the weights
    ``energy`` (n_stiffnesses,), their shares of strain energy.
    """
    length = float(np.exp(learned.best[-1]))
    measured = joint_kernels(learned.evidence.distances, length)
    shares = [
        1 - float(k[0] @ np.linalg.solve(kernel + POSTURES.exact_variance * np.eye(len(kernel)), k[0]))
        for k, kernel in zip(joint_kernels(cross, length), measured, strict=True)
    ]
    return float(np.asarray(energy) @ np.array(shares) / np.sum(energy))


@dataclass(frozen=True)
class PredictedPosture:
    """Modes predicted in one posture.

    Parameters
    ----------
    model
        Modal model with the mean of the draws, and their covariance; receptance of the tip over X, Y, Z.
    draws
        Modal models drawn, their modes in the order of ``model``.
    remaining_variance
        Share of the variance over postures that the measurements would leave if they were exact: 0 at a measured
        posture, 1 where nothing is known but what all postures share.
    """

    model: ModalModel
    draws: tuple[ModalModel, ...]
    remaining_variance: float

    @property
    def far(self) -> bool:
        """Check whether the posture is far from all measured ones: only factors common to all postures are known."""
        return self.remaining_variance > POSTURES.far

    @property
    def warnings(self) -> tuple[str, ...]:
        """Return one warning if the posture is far from every measured posture; otherwise none."""
        if not self.far:
            return ()
        return (
            f"far from every measured posture: the measurements leave {100 * self.remaining_variance:.0f} % of the "
            "variance over postures, so little is known but what all postures share; measure a nearer posture",
        )

    def frequency_band(self, share: float = 0.95) -> Real:
        """Return lower and upper end of the confidence band of each natural frequency, (2, n_modes), Hz."""
        return _band(np.array([draw.natural_frequencies for draw in self.draws]), share)

    def damping_band(self, share: float = 0.95) -> Real:
        """Return lower and upper end of the confidence band of each damping ratio, (2, n_modes)."""
        return _band(np.array([draw.damping_ratios for draw in self.draws]), share)

    def receptance_band(self, frequencies: Real, share: float = 0.95) -> Real:
        """Return lower and upper end of the confidence band of the magnitude, (2, n_frequencies, 3, 3), m/N."""
        return _band(np.array([np.abs(draw.receptance(frequencies)) for draw in self.draws]), share)


def _band(values: Real, share: float) -> Real:
    return np.asarray(np.quantile(values, [(1 - share) / 2, (1 + share) / 2], axis=0))


def predict_posture(
    learned: LearnedPostures, driven: Real, *, axes: Real | None = None, samples: int = POSTURES.model_draws
) -> PredictedPosture:
    """Predict the modes in a posture, given what was measured in others.

    Hyperparameters are taken from their draws, unknowns from their normal distribution given the measurements, and the
    robot's modes are solved for each: no linearisation at the new posture.

    Parameters
    ----------
    learned
        Process over postures.
    driven : (n_active,), rad or m
        Driven joint values.
    axes : (3, 3) or None
        X, Y, Z of the predicted models as columns, in the base frame; None: the base frame.
    samples
        Number of models to draw.

    Raises
    ------
    InputError
        A posture that the robot's loops cannot close.
    """
    basis, place = basis_at(learned.robot, driven)
    cross, within = distances_to(learned, place)
    n, m = len(basis.stiffness), len(basis.mass)
    unknowns = unknown_rows(0, n, m)
    mean = conditioned(learned.evidence, learned.best).predict(unknowns, cross, within)[0]
    modes = corrected_modes(basis, mean[:n], mean[n : n + m])
    highest = POSTURES.highest_mode * max(float(case.frequencies.max()) for case in learned.measured)
    n_modes = max(1, int(np.sum(modes.natural < 2 * np.pi * highest)))
    rows = joined([unknowns, *[discrepancy_rows(0, modes, r, np.eye(3)) for r in range(n_modes)]])
    target = _Target(learned, basis, modes, n_modes, np.eye(3) if axes is None else np.asarray(axes, dtype=float))
    rng, models = np.random.default_rng(0), []
    per_draw = -(-samples // len(learned.draws))
    for hyper in learned.draws:
        average, spread = conditioned(learned.evidence, hyper).predict(rows, cross, within)
        values, vectors = np.linalg.eigh(spread)
        # the symmetric root does not depend on the signs and order of the eigenvectors, which rounding changes
        root = (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
        models += [target.model(draw) for draw in average + rng.normal(size=(per_draw, len(rows))) @ root]
    energy = modes.shares[: min(POSTURES.n_lowest, n_modes)].mean(axis=0)
    return PredictedPosture(_mean_model(models), tuple(models), _remaining_variance(learned, energy, cross))


@dataclass(frozen=True)
class _Target:
    """The new posture with its expected modes, of which the lowest ``n_modes`` are predicted."""

    learned: LearnedPostures
    basis: ModalBasis
    modes: CorrectedModes
    n_modes: int
    axes: Real

    def model(self, draw: Real) -> ModalModel:
        """Build the modal model from one draw of the unknowns and of the deviations that they do not explain."""
        n, m = len(self.basis.stiffness), len(self.basis.mass)
        stiffness, mass, damping, joint_damping, further = np.split(draw, np.cumsum([n, m, 1, n]))
        discrepancies = further.reshape(self.n_modes, -1)
        modes = corrected_modes(self.basis, stiffness, mass)
        order, signs = self._order(modes)
        natural = modes.natural[order] * np.exp(discrepancies[:, 0])
        loss = damping + modes.shares[order] @ joint_damping + discrepancies[:, 1]
        ratios = np.minimum(modelled_damping(self.learned.robot, natural) * np.exp(loss), 0.5)
        tip = modes.tip[order] * signs[:, None]
        sizes = np.linalg.norm(self.modes.tip[: self.n_modes], axis=1)[:, None]
        tip = (tip + sizes * discrepancies[:, 2:]) @ self.axes
        # higher modes are static flexibility
        higher = np.setdiff1d(np.arange(len(modes.natural)), order)
        static = (modes.tip[higher] @ self.axes) / modes.natural[higher, None]
        residuals = Residuals(static.T @ static, np.zeros((3, 3))) if len(higher) else None
        return _modal_model(natural, ratios, tip.astype(complex), residuals)

    def _order(self, modes: CorrectedModes) -> tuple[NDArray[np.int64], Real]:
        """Find for each expected mode the mode of a draw with the most similar shape, and the sign that aligns it."""
        product = self.modes.vectors[:, : self.n_modes].T @ modes.vectors
        similarity = product**2 / np.sum(modes.vectors**2, axis=0)
        order = scipy.optimize.linear_sum_assignment(-similarity)[1]
        return order, np.where(product[np.arange(self.n_modes), order] < 0, -1.0, 1.0)


def _modal_model(natural: Real, ratios: Real, right: NDArray[np.complex128], residuals: Residuals | None) -> ModalModel:
    damped = natural * np.sqrt(1 - ratios**2)
    left = right / (2j * damped[:, None])
    return ModalModel(-ratios * natural + 1j * damped, right, left, TIP, TIP, residuals=residuals)


def _mean_model(models: list[ModalModel]) -> ModalModel:
    """Average drawn models (logarithms of frequency and damping; shapes) and add the covariance of the draws."""
    natural = np.exp(np.mean([np.log(model.natural_frequencies) for model in models], axis=0)) * 2 * np.pi
    ratios = np.exp(np.mean([np.log(model.damping_ratios) for model in models], axis=0))
    right = np.mean([model.right for model in models], axis=0)
    terms = [model.residuals for model in models if model.residuals is not None]
    residuals = None
    if terms:
        upper, lower = ([getattr(term, name) for term in terms] for name in ("upper", "lower"))
        residuals = Residuals(np.mean(upper, axis=0), np.mean(lower, axis=0))
    mean = _modal_model(natural, ratios, right, residuals)
    deviations = np.array([pack_parameters(model) for model in models]) - pack_parameters(mean)
    return replace(mean, covariance=deviations.T @ deviations / len(models))
