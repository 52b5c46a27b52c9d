"""Prediction of modal models, with confidence bands, in postures without measurements."""

from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import TIP, Real
from modal_fit import ModalModel, Residuals, pack_parameters

from .learning import LearnedPostures
from .modal_basis import CorrectedModes, ModalBasis, PosturePlace, basis_at, corrected_modes, modelled_damping
from .process import Evidence, SquaredDistances, covariance_of, covariance_parts, joint_kernels, squared_distances
from .process_rows import Rows, joined, mode_rows, unknown_rows

EXACT = 0.02
"""Variance of a measurement, as a share, that counts as exact: how far a posture is must not depend on noise."""


@dataclass(frozen=True)
class Conditioned:
    """The process with one set of hyperparameters, given the measurements.

    Parameters
    ----------
    hyper
        Logarithms of the hyperparameters.
    evidence
        Measured rows and the distances of their postures.
    root
        Lower Cholesky factor of their covariance.
    pulled
        That covariance's inverse times the measured values.
    """

    hyper: Real
    evidence: Evidence
    root: Real
    pulled: Real

    @property
    def length(self) -> float:
        """Length scale of the kernels."""
        return float(np.exp(self.hyper[-1]))

    def given(self, rows: Rows, across: SquaredDistances, within: SquaredDistances) -> tuple[Real, Real]:
        """Mean (n,) and covariance (n, n) of rows, given the measurements, scatter included.

        Parameters
        ----------
        across, within
            Squared distances of the rows' postures to the measured ones, and among themselves.
        """
        squares = np.exp(2 * self.hyper[:-1])
        cross = np.tensordot(squares, covariance_parts(rows, self.evidence.rows, across, self.length, False), 1)
        own = np.tensordot(squares, covariance_parts(rows, rows, within, self.length, True), 1)
        reduced = scipy.linalg.solve_triangular(self.root, cross.T, lower=True)
        return cross @ self.pulled, own - reduced.T @ reduced


def conditioned(evidence: Evidence, hyper: Real) -> Conditioned:
    """Factor the measured rows' covariance once, for all that is asked of it."""
    factor = scipy.linalg.cho_factor(covariance_of(hyper, evidence), lower=True)
    return Conditioned(hyper, evidence, np.tril(factor[0]), scipy.linalg.cho_solve(factor, evidence.rows.value))


def distances_to(learned: LearnedPostures, places: list[PosturePlace]) -> tuple[SquaredDistances, SquaredDistances]:
    """Squared distances of new postures to the measured ones, and among themselves."""
    return (
        squared_distances(learned.metric, places, list(learned.places)),
        squared_distances(learned.metric, places, places),
    )


def left_unknown(learned: LearnedPostures, energy: Real, across: SquaredDistances) -> float:
    """Share of the variance over postures that exact measurements would leave in one new posture.

    ``1 - k^T (K + 0.02 I)^-1 k`` of each elastic part's kernel, weighed by the parts' shares of energy.

    Parameters
    ----------
    learned
        Process over postures.
    energy : (n_stiffnesses,)
        Shares of the elastic parts in the energy of the modes that matter.
    across
        Squared distances of the posture to the measured ones.
    """
    length = float(np.exp(learned.best[-1]))
    own = joint_kernels(learned.evidence.distances, length)
    left = [
        1 - float(near[0] @ np.linalg.solve(among + EXACT * np.eye(len(among)), near[0]))
        for near, among in zip(joint_kernels(across, length), own, strict=True)
    ]
    return float(np.asarray(energy) @ np.array(left) / np.sum(energy))


SAMPLES = 240
"""Modal models that are drawn."""

LOWEST = 3
"""Modes whose energy says which joints matter for how far a posture is."""

FAR = 0.5
"""Share of the variance over postures, left by the measurements, from which a posture is far from all of them."""

REACH = 2.0
"""Modes are kept as modes up to so many times the highest measured frequency; higher ones are static flexibility."""


@dataclass(frozen=True)
class PredictedPosture:
    """Modes predicted in one posture.

    Parameters
    ----------
    model
        Modal model in the middle of the draws, with their covariance; receptance of the tip over X, Y, Z.
    draws
        Modal models drawn, their modes in the order of ``model``.
    left_unknown
        Share of the variance over postures that the measurements would leave if they were exact: 0 at a measured
        posture, 1 where nothing is known but what all postures share.
    """

    model: ModalModel
    draws: tuple[ModalModel, ...]
    left_unknown: float

    @property
    def far(self) -> bool:
        """Whether the posture is far from every measured one: the band is then the model's own."""
        return self.left_unknown > FAR

    @property
    def warnings(self) -> tuple[str, ...]:
        """A sentence where the posture is far from every measured one."""
        if not self.far:
            return ()
        return (
            f"far from every measured posture: the measurements leave {100 * self.left_unknown:.0f} % of the variance "
            "over postures, and the band goes back to what all postures share; measure nearer",
        )

    def frequency_band(self, share: float = 0.95) -> Real:
        """Ends of the band of each natural frequency, (2, n_modes), Hz."""
        return _band(np.array([one.natural_frequencies for one in self.draws]), share)

    def damping_band(self, share: float = 0.95) -> Real:
        """Ends of the band of each damping ratio, (2, n_modes)."""
        return _band(np.array([one.damping_ratios for one in self.draws]), share)

    def receptance_band(self, frequencies: Real, share: float = 0.95) -> Real:
        """Ends of the band of every receptance's magnitude, (2, n_frequencies, 3, 3), m/N."""
        return _band(np.array([np.abs(one.receptance(frequencies)) for one in self.draws]), share)


def predict_posture(
    learned: LearnedPostures, driven: Real, *, axes: Real | None = None, samples: int = SAMPLES, seed: int = 0
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
        X, Y, Z of the wanted models as columns, in the base frame; None: the base frame.
    samples
        Number of models to draw.
    seed
        Seed of the generator that draws.

    Raises
    ------
    InputError
        A posture that the robot's loops cannot close.
    """
    basis, place = basis_at(learned.robot, driven)
    across, within = distances_to(learned, [place])
    count = len(basis.stiffness), len(basis.mass)
    unknown = unknown_rows(0, *count)
    mean = conditioned(learned.evidence, learned.best).given(unknown, across, within)[0]
    modes = corrected_modes(basis, mean[: count[0]], mean[count[0] : sum(count)])
    kept = _kept(learned, modes)
    rows = joined([unknown, *[mode_rows(0, modes, r, np.eye(3)) for r in range(kept)]])
    turn = np.eye(3) if axes is None else np.asarray(axes, dtype=float)
    target = _Target(learned, basis, modes, kept, turn)
    rng, drawn = np.random.default_rng(seed), []
    share = -(-samples // len(learned.draws))
    for hyper in learned.draws:
        average, covariance = conditioned(learned.evidence, hyper).given(rows, across, within)
        values, vectors = np.linalg.eigh(covariance)
        spread = (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T  # the one root that rounding does not turn
        drawn += [_drawn(target, one) for one in average + rng.normal(size=(share, len(rows))) @ spread]
    energy = modes.shares[: min(LOWEST, kept)].mean(axis=0)
    return PredictedPosture(_in_the_middle(drawn), tuple(drawn), left_unknown(learned, energy, across))


@dataclass(frozen=True)
class _Target:
    """The new posture: its modes in the middle, and how many of them are kept."""

    learned: LearnedPostures
    basis: ModalBasis
    modes: CorrectedModes
    kept: int
    axes: Real


def _kept(learned: LearnedPostures, modes: CorrectedModes) -> int:
    top = REACH * max(float(one.frequencies.max()) for one in learned.measured)
    return max(1, int(np.sum(modes.natural < 2 * np.pi * top)))


def _drawn(target: _Target, draw: Real) -> ModalModel:
    """One modal model from the unknowns and the discrepancies of one draw."""
    basis, kept = target.basis, target.kept
    first, second = len(basis.stiffness), len(basis.stiffness) + len(basis.mass)
    last = second + 1 + first
    modes = corrected_modes(basis, draw[:first], draw[first:second])
    order, signs = _in_order(target.modes, modes, kept)
    beside = draw[last:].reshape(kept, -1)
    natural = modes.natural[order] * np.exp(beside[:, 0])
    loss = draw[second] + modes.shares[order] @ draw[second + 1 : last] + beside[:, 1]
    ratios = np.minimum(modelled_damping(target.learned.robot, natural) * np.exp(loss), 0.5)
    tip = modes.tip[order] * signs[:, None]
    tip = (tip + np.linalg.norm(target.modes.tip[:kept], axis=1)[:, None] * beside[:, 2:]) @ target.axes
    damped = natural * np.sqrt(1 - ratios**2)
    left_out = np.setdiff1d(np.arange(len(modes.natural)), order)
    static = (modes.tip[left_out] @ target.axes) / modes.natural[left_out, None]
    residuals = Residuals(static.T @ static, np.zeros((3, 3))) if len(left_out) else None
    right = tip.astype(complex)
    return ModalModel(
        -ratios * natural + 1j * damped, right, right / (2j * damped[:, None]), TIP, TIP, residuals=residuals
    )


def _in_order(middle: CorrectedModes, modes: CorrectedModes, kept: int) -> tuple[NDArray[np.int64], Real]:
    """Which mode of a draw is which in the middle, by their whole shapes, and the sign that makes them alike."""
    product = middle.vectors[:, :kept].T @ modes.vectors
    likeness = product**2 / np.sum(modes.vectors**2, axis=0)
    order = scipy.optimize.linear_sum_assignment(-likeness)[1]
    return order, np.where(product[np.arange(kept), order] < 0, -1.0, 1.0)


def _in_the_middle(drawn: list[ModalModel]) -> ModalModel:
    """Model of the means of logarithms and of shapes, with the covariance of the draws about it."""
    natural = np.exp(np.mean([np.log(one.natural_frequencies) for one in drawn], axis=0)) * 2 * np.pi
    ratios = np.exp(np.mean([np.log(one.damping_ratios) for one in drawn], axis=0))
    right = np.mean([one.right for one in drawn], axis=0)
    damped = natural * np.sqrt(1 - ratios**2)
    terms = [one.residuals for one in drawn if one.residuals is not None]
    residuals = (
        Residuals(np.mean([one.upper for one in terms], axis=0), np.mean([one.lower for one in terms], axis=0))
        if terms
        else None
    )
    model = ModalModel(
        -ratios * natural + 1j * damped, right, right / (2j * damped[:, None]), TIP, TIP, residuals=residuals
    )
    away = np.array([pack_parameters(one) for one in drawn]) - pack_parameters(model)
    return replace(model, covariance=away.T @ away / len(drawn))


def _band(values: Real, share: float) -> Real:
    return np.asarray(np.quantile(values, [(1 - share) / 2, (1 + share) / 2], axis=0))
