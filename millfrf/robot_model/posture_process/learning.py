"""Most probable unknowns and hyperparameters from modes measured in some postures, and their JSON file."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
import scipy
from pydantic import BaseModel, ConfigDict, Field, PositiveFloat, PositiveInt, ValidationError

from millfrf.core import FileFormatError, InputError, Real, mistake_in_words, read_json, write_json

from ..kinematics.mechanism import typed_values
from ..settings import POSTURES
from ..spatial.spatial_robot import SpatialRobot
from .modal_basis import (
    CorrectedModes,
    MeasuredModes,
    ModalBasis,
    Pairs,
    PosturePlace,
    arc_weights,
    basis_at,
    corrected_modes,
    mode_pairs,
    modelled_damping,
    part_names,
)
from .process import (
    MEDIANS,
    NAMES,
    Evidence,
    PostureMetric,
    Rows,
    SquaredDistances,
    best_hyperparameters,
    covariance,
    drawn_hyperparameters,
    joined,
    measured_covariance,
    measured_rows,
    posture_metric,
    selected,
    squared_distances,
    unknown_rows,
)


@dataclass(frozen=True)
class _Problem:
    """Measurements and computed data that do not depend on the unknowns; one entry per measurement."""

    robot: SpatialRobot
    measured: tuple[MeasuredModes, ...]
    bases: tuple[ModalBasis, ...]
    places: tuple[PosturePlace, ...]
    metric: PostureMetric
    distances: SquaredDistances


def _problem(robot: SpatialRobot, measured: tuple[MeasuredModes, ...]) -> _Problem:
    bases, places = zip(*(basis_at(robot, case.driven) for case in measured), strict=True)
    metric = posture_metric(robot, arc_weights(robot, np.array([case.driven for case in measured])), list(places))
    distances = squared_distances(metric, list(places), list(places))
    return _Problem(robot, measured, bases, places, metric, distances)


def _pairs_as_modelled(problem: _Problem) -> tuple[Pairs, ...]:
    return tuple(
        _pairs(case, corrected_modes(basis, np.zeros(len(basis.stiffness)), np.zeros(len(basis.mass))), False)
        for case, basis in zip(problem.measured, problem.bases, strict=True)
    )


def _pairs_from_others(problem: _Problem, rows: Rows, hyper: Real) -> tuple[Pairs, ...]:
    """Pair the modes measured in each posture with modes that are predicted from all other postures.

    A prediction from the same posture would confirm its own wrong pairs, because the unknowns had been fitted to them.
    """
    pairs = []
    for p, (case, basis) in enumerate(zip(problem.measured, problem.bases, strict=True)):
        unknowns = _expected(problem, selected(rows, rows.posture != p), hyper, [p])[0]
        n, m = len(basis.stiffness), len(basis.mass)
        pairs.append(_pairs(case, corrected_modes(basis, unknowns[:n], unknowns[n : n + m]), True))
    return tuple(pairs)


def _pairs(measured: MeasuredModes, modes: CorrectedModes, corrected: bool) -> Pairs:
    """Pair measured and computed modes of one posture; ``corrected`` modes are paired within narrower scales."""
    scales = POSTURES.learned_pairing_scales if corrected else POSTURES.pairing_scales
    tip = modes.tip @ measured.directions.T
    pairs = mode_pairs(measured.frequencies, measured.shapes, modes.natural / (2 * np.pi), tip, scales)
    if not pairs:
        frequencies = ", ".join(f"{frequency:.1f}" for frequency in measured.frequencies)
        raise InputError(
            f"{measured.name}: none of the measured modes ({frequencies} Hz) is near one of the model's "
            f"({modes.natural[0] / (2 * np.pi):.1f} Hz and above); check the posture"
        )
    return pairs


def _linear_rows(problem: _Problem, stiffness: Real, mass: Real, pairs: Sequence[Pairs]) -> Rows:
    """Build the rows of all measured modes, linearised at the logarithms ``stiffness`` and ``mass``."""
    parts = []
    for p, (measured, basis) in enumerate(zip(problem.measured, problem.bases, strict=True)):
        modes = corrected_modes(basis, stiffness[p], mass)
        ratios = modelled_damping(problem.robot, modes.natural)
        parts.append(measured_rows(p, measured, pairs[p], basis, modes, ratios, (stiffness[p], mass)))
    return joined(parts)


def _gauss_newton_step(problem: _Problem, rows: Rows, hyper: Real, stiffness: Real, mass: Real) -> tuple[Real, Real]:
    expected = _expected(problem, rows, hyper, list(range(len(stiffness))))
    n, limit = stiffness.shape[1], POSTURES.largest_step
    # the step is limited because the modes are linear in the unknowns only nearby
    new = np.clip(expected[:, :n] - stiffness, -limit, limit) + stiffness
    return new, np.clip(expected[0, n : n + len(mass)] - mass, -limit, limit) + mass


def _expected(problem: _Problem, rows: Rows, hyper: Real, postures: list[int]) -> Real:
    """Compute the expected unknowns in the given ``postures`` from measured rows, (n_postures, n_unknowns)."""
    factor = scipy.linalg.cho_factor(measured_covariance(hyper, Evidence(rows, problem.distances)), lower=True)
    n_stiffnesses, n_masses = len(problem.bases[0].stiffness), len(problem.bases[0].mass)
    unknowns = joined([unknown_rows(p, n_stiffnesses, n_masses) for p in postures])
    cross = covariance(hyper, unknowns, rows, problem.distances)
    return np.asarray((cross @ scipy.linalg.cho_solve(factor, rows.value)).reshape(len(postures), -1))


@dataclass(frozen=True)
class LearnedPostures:
    """A robot's model with a Gaussian process over postures, conditioned on modes measured in some of them.

    Parameters
    ----------
    robot
        Robot whose model is the mean of the process.
    measured
        Modes measured in the postures.
    pairs
        For each posture, indices of measured and computed modes that are the same.
    best : (n_hyperparameters,)
        Logarithms of the hyperparameters at the largest posterior.
    draws : (n_draws, n_hyperparameters)
        Logarithms of the hyperparameters drawn from their posterior.
    stiffness : (n_postures, n_stiffnesses)
        Logarithms of the stiffness factors in each posture, about which the modes are linear.
    mass : (n_masses,)
        Logarithms of the mass factors.
    evidence
        Measured rows and the squared distances of their postures.
    metric, places
        Scales of the distances of postures, and the coordinates of the measured ones.
    """

    robot: SpatialRobot
    measured: tuple[MeasuredModes, ...]
    pairs: tuple[Pairs, ...]
    best: Real
    draws: Real
    stiffness: Real
    mass: Real
    evidence: Evidence
    metric: PostureMetric
    places: tuple[PosturePlace, ...]

    def frequency_ratios(self) -> tuple[Real, ...]:
        """Measured over modelled frequencies of the paired modes in each posture, for the model before learning."""
        ratios = []
        for case, pairs in zip(self.measured, self.pairs, strict=True):
            natural = np.sqrt(basis_at(self.robot, case.driven)[0].squares) / (2 * np.pi)
            ratios.append(np.array([case.frequencies[i] / natural[r] for i, r in pairs]))
        return tuple(ratios)

    @property
    def unpaired(self) -> tuple[tuple[str, float], ...]:
        """Measured modes without a computed partner: posture and frequency, Hz."""
        return tuple(
            (case.name, float(case.frequencies[i]))
            for case, pairs in zip(self.measured, self.pairs, strict=True)
            for i in range(len(case.frequencies))
            if i not in {pair[0] for pair in pairs}
        )


def learn_postures(robot: SpatialRobot, measured: Sequence[MeasuredModes]) -> LearnedPostures:
    """Learn how a robot's measured modes differ from its model, over postures.

    ``log f = log f_r(s(q), m) + e``: factors ``s(q)`` on the joints' stiffness vary over postures as Gaussian
    processes; factors ``m`` on the masses are constant; the process ``e`` contains deviations that no factor explains.
    Damping and the motion of the tip have the same form. The modes are linearised at the most probable factors.

    Parameters
    ----------
    robot
        Robot as modelled, best after its constants were updated.
    measured
        Modes measured in two postures or more.

    Raises
    ------
    InputError
        Fewer than two postures, a robot without masses, or a posture in which no measured mode is near the model's.
    """
    if len(measured) < 2:
        raise InputError(f"{len(measured)} measured posture: give two or more, best eight")
    problem = _problem(robot, tuple(measured))
    best = np.log(MEDIANS)
    stiffness = np.zeros((len(problem.places), len(problem.bases[0].stiffness)))
    mass = np.zeros(len(problem.bases[0].mass))
    pairs = _pairs_as_modelled(problem)
    for iteration in range(POSTURES.rounds):
        for _ in range(POSTURES.steps):
            rows = _linear_rows(problem, stiffness, mass, pairs)
            stiffness, mass = _gauss_newton_step(problem, rows, best, stiffness, mass)
            if iteration < POSTURES.rounds - 1:  # in the last round the pairs stay, so that the unknowns converge
                pairs = _pairs_from_others(problem, rows, best)
        rows = _linear_rows(problem, stiffness, mass, pairs)
        best = best_hyperparameters(Evidence(rows, problem.distances), best)
    draws = drawn_hyperparameters(Evidence(rows, problem.distances), best)
    return assembled(robot, measured, pairs, (best, draws), (stiffness, mass))


def assembled(
    robot: SpatialRobot,
    measured: Sequence[MeasuredModes],
    pairs: tuple[Pairs, ...],
    hyperparameters: tuple[Real, Real],
    unknowns: tuple[Real, Real],
) -> LearnedPostures:
    """Build the process from known pairs, hyperparameters (best, draws) and unknowns (stiffness, mass)."""
    problem = _problem(robot, tuple(measured))
    evidence = Evidence(_linear_rows(problem, *unknowns, pairs), problem.distances)
    return LearnedPostures(
        robot, problem.measured, pairs, *hyperparameters, *unknowns, evidence, problem.metric, problem.places
    )


class _Table(BaseModel):
    model_config = ConfigDict(extra="ignore", allow_inf_nan=False)


# A factor, or a standard deviation of its logarithm. Its exponential and its square must be numbers.
Factor = Annotated[float, Field(gt=1e-6, lt=1e6)]


class _Mode(_Table):
    frequency_hz: PositiveFloat
    damping_ratio: PositiveFloat
    shape: list[float]
    relative_errors: tuple[PositiveFloat, PositiveFloat, PositiveFloat]
    model_mode: PositiveInt | None


class _Posture(_Table):
    name: str
    driven_rad_m: list[float]
    directions: list[tuple[float, float, float]]
    modelled_frequencies_hz: list[PositiveFloat]
    stiffness_factors: dict[str, Factor]
    modes: list[_Mode]


class _Hyperparameters(_Table):
    best: dict[str, Factor]
    draws: list[Annotated[list[Factor], Field(min_length=len(NAMES), max_length=len(NAMES))]]


class _File(_Table):
    format: Literal["millfrf.learned_postures"]
    format_version: Literal[1]
    postures: list[_Posture]
    mass_factors: dict[str, Factor]
    hyperparameters: _Hyperparameters


def write_learned_postures(path: str | os.PathLike[str], learned: LearnedPostures) -> None:
    """Write the measured modes, their pairs with the model's, the factors and the hyperparameters.

    Parameters
    ----------
    path
        JSON file to write; an existing one is replaced when the new one is complete.
    learned
        Process over postures.

    Raises
    ------
    InputError
        The folder cannot be written to.
    """
    joints, bodies = part_names(learned.robot)
    content = {
        "format": "millfrf.learned_postures",
        "format_version": 1,
        "what": "measured modes over postures as a Gaussian process about a robot's model",
        "postures": [_posture(learned, p, joints) for p in range(len(learned.measured))],
        "mass_factors": _named(bodies, np.exp(learned.mass)),
        "hyperparameters": {
            "what": "standard deviations of logarithms (shapes: shares), and the length scale of the kernels",
            "best": _named(NAMES, np.exp(learned.best)),
            "draws_in_order_of": list(NAMES),
            "draws": np.exp(learned.draws).tolist(),
        },
    }
    write_json(path, content)


def read_learned_postures(path: str | os.PathLike[str], robot: SpatialRobot) -> LearnedPostures:
    """Read what :func:`write_learned_postures` wrote, for the robot with which it was learned.

    Parameters
    ----------
    path
        File that :func:`write_learned_postures` wrote.
    robot
        Robot with which it was learned.

    Raises
    ------
    InputError
        No such file, or another robot.
    FileFormatError
        Another format, or fields that are missing or wrong.
    """
    try:
        content = _File.model_validate(read_json(path, "a file that 'millfrf robot learn' wrote"))
    except ValidationError as error:
        raise FileFormatError(f"{path} holds no learned postures: {mistake_in_words(error, _File)}") from error
    joints, bodies = part_names(robot)
    try:
        measured = tuple(_measured(posture) for posture in content.postures)
        stiffness = np.log([[posture.stiffness_factors[name] for name in joints] for posture in content.postures])
        mass = np.log([content.mass_factors[name] for name in bodies])
        best = np.log([content.hyperparameters.best[name] for name in NAMES])
        draws = np.log(np.array(content.hyperparameters.draws, dtype=float).reshape(-1, len(NAMES)))
    except KeyError as error:
        raise InputError(
            f"{path} has no value of {error.args[0]}: it was learned with another robot; give that robot's file"
        ) from error
    except ValueError as error:
        raise FileFormatError(f"{path}: lists of unequal length ({error}); learn it again") from error
    for posture in content.postures:
        _refuse_other_robot(path, robot, posture)
    pairs = tuple(
        tuple((i, mode.model_mode - 1) for i, mode in enumerate(posture.modes) if mode.model_mode is not None)
        for posture in content.postures
    )
    return assembled(robot, measured, pairs, (best, draws), (stiffness, mass))


def _refuse_other_robot(path: str | os.PathLike[str], robot: SpatialRobot, posture: _Posture) -> None:
    if len(posture.driven_rad_m) != int(robot.mechanism.active.sum()):
        raise InputError(f"{path} was learned with a robot of {len(posture.driven_rad_m)} driven joints; give that one")
    now = _modelled_frequencies(robot, np.array(posture.driven_rad_m))
    then = np.array(posture.modelled_frequencies_hz)
    if len(now) != len(then) or np.abs(now / then - 1).max() > POSTURES.same_robot:
        raise InputError(
            f"{path} was learned with another robot: in posture {posture.name!r} its first mode was modelled at "
            f"{then[0]:.3f} Hz, now at {now[0]:.3f} Hz; give the same robot file, or learn again"
        )


def _modelled_frequencies(robot: SpatialRobot, driven: Real) -> Real:
    """Compute the six lowest natural frequencies of the model, Hz."""
    return np.sqrt(basis_at(robot, driven)[0].squares[:6]) / (2 * np.pi)


def _posture(learned: LearnedPostures, index: int, joints: tuple[str, ...]) -> dict[str, Any]:
    measured, partners = learned.measured[index], dict(learned.pairs[index])
    modes = [
        {
            "frequency_hz": float(measured.frequencies[i]),
            "damping_ratio": float(measured.damping[i]),
            "shape": measured.shapes[i].tolist(),
            "relative_errors": measured.errors[i].tolist(),
            "model_mode": partners[i] + 1 if i in partners else None,
        }
        for i in range(len(measured.frequencies))
    ]
    return {
        "name": measured.name,
        "driven_rad_m": measured.driven.tolist(),
        "driven_deg_m": typed_values(learned.robot.mechanism, measured.driven).tolist(),
        "directions": measured.directions.tolist(),
        "modelled_frequencies_hz": _modelled_frequencies(learned.robot, measured.driven).tolist(),
        "stiffness_factors": _named(joints, np.exp(learned.stiffness[index])),
        "modes": modes,
    }


def _measured(posture: _Posture) -> MeasuredModes:
    return MeasuredModes(
        posture.name,
        np.array(posture.driven_rad_m, dtype=float),
        np.array([mode.frequency_hz for mode in posture.modes]),
        np.array([mode.damping_ratio for mode in posture.modes]),
        np.array([mode.shape for mode in posture.modes], dtype=float).reshape(
            len(posture.modes), len(posture.directions)
        ),
        np.array([mode.relative_errors for mode in posture.modes]),
        np.array(posture.directions, dtype=float),
    )


def _named(names: tuple[str, ...], values: Real) -> dict[str, float]:
    return {name: float(value) for name, value in zip(names, values, strict=True)}
