"""Screening of a further mode, and fits of linear causes in one round of the search."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimation import WindowedSpectrum
from millfrf.core import Complex, Real

from ..inference.search import Proposal, in_processes
from ..inference.settings import ScreeningSettings
from ..models.cause import Cause
from ..models.fitting import Fit, at_nominal_modes, fit, modes_are_implausible, with_chain_from_belief
from ..models.hypothesis import Hypothesis
from ..models.model_terms import ALL_FAMILIES, with_free_forms
from ..physics.linear_causes import AcCoupling, MissingMode, TransducerResonance
from ..physics.protocol import ChainPhysics, JointPhysics, Physics, reported_name
from .score_tests import ScreenedChain, gain_of_chain, screen_joints
from .whitened_residual import Floor, FloorRecord, noise_floor

DAMPINGS = (0.015, 0.05)
FREQUENCIES = 48
LINE_STEP = 3  # every third line is used to scan the poles, which needs no precision


@dataclass(frozen=True)
class ScreenedMode:
    """A further pole with a residue of rank one, and its gain in misfit."""

    physics: MissingMode  # the cause that adds it
    pole: complex  # its pole, rad/s
    right: Complex  # right vector of the residue ``right left^T``, m/(N s), (n_responses,)
    left: Complex  # left vector of that residue, (n_excitations,)
    gain: float


def find_mode(floor: Floor, hypothesis: Hypothesis, physics: MissingMode) -> ScreenedMode:
    """Return the pole and the residue of rank one that explain most of the residual.

    For each pole of a grid over the band, a residue of full rank is fitted by linear least squares, with the modal
    parameters adapted. The best residue is reduced to rank one by its singular value decomposition.
    """
    low = min(record.lines.frequencies[0] for record in floor.records)
    high = max(record.lines.frequencies[-1] for record in floor.records)
    best: tuple[float, complex, Real] | None = None
    thinned = _thinned(floor, hypothesis)
    for frequency in np.geomspace(1.3 * low, 0.95 * high, FREQUENCIES):
        for damping in DAMPINGS:
            pole = 2 * np.pi * frequency * (-damping + 1j * np.sqrt(1 - damping**2))
            gain, residue = _residue(thinned, pole)
            if best is None or gain > best[0]:
                best = gain, pole, residue
    assert best is not None
    gain, pole, numbers = best
    n, m = floor.records[0].through.shape[1:]
    parts = numbers.reshape(2, n, m)
    u, s, vh = np.linalg.svd(parts[0] + 1j * parts[1])
    scale = np.sqrt(s[0] * np.linalg.norm(hypothesis.model.left) / np.linalg.norm(hypothesis.model.right))
    return ScreenedMode(physics, pole, u[:, 0] * s[0] / scale, vh[0] * scale, gain * s[0] ** 2 / np.sum(s**2))


@dataclass(frozen=True)
class _Thin:
    """Every third line of a floor: derivatives and residuals of the recordings, and their normal equations."""

    records: tuple[tuple[FloorRecord, Real, Real], ...]
    inverse: Real
    gradient: Real


def _thinned(floor: Floor, hypothesis: Hypothesis) -> _Thin:
    size = len(floor.gradient)
    matrix, gradient = np.diag(np.full(size, 1e-6)), np.zeros(size)
    shape = hypothesis.shape
    matrix[np.arange(shape.size), np.arange(shape.size)] = shape.prior_precision
    gradient[: shape.size] = -shape.prior_precision * hypothesis.u
    records = []
    for record in floor.records:
        chosen = _chosen(record)
        slope, residual = record.slope[chosen], record.white_residual[chosen]
        matrix += 2 * LINE_STEP * slope.T @ slope
        gradient += 2 * LINE_STEP * slope.T @ residual
        records.append((record, slope, residual))
    return _Thin(tuple(records), np.asarray(np.linalg.inv(matrix), dtype=float), gradient)


def _residue(thin: _Thin, pole: complex) -> tuple[float, Real]:
    """Return the gain in misfit and the best residue of a pole, real parts followed by imaginary parts."""
    through = thin.records[0][0].through
    count = 2 * through.shape[1] * through.shape[2]
    own, shared, gradient = np.zeros((count, count)), np.zeros((len(thin.gradient), count)), np.zeros(count)
    for record, slope, residual in thin.records:
        columns = _columns(record, pole)
        own += 2 * LINE_STEP * columns.T @ columns
        shared += 2 * LINE_STEP * slope.T @ columns
        gradient += 2 * LINE_STEP * columns.T @ residual
    solved = thin.inverse @ shared
    reduced, reduced_gradient = own - shared.T @ solved, gradient - solved.T @ thin.gradient
    residue = np.asarray(np.linalg.lstsq(reduced, reduced_gradient, rcond=1e-8)[0], dtype=float)
    return float(reduced_gradient @ residue), residue


def _chosen(record: FloorRecord) -> NDArray[np.int64]:
    """Return the rows of the real system that belong to every third line."""
    n_lines, n = record.residual.shape
    rows = (np.arange(0, n_lines, LINE_STEP)[:, None] * n + np.arange(n)).ravel()
    return np.concatenate([rows, rows + n_lines * n])


def _columns(record: FloorRecord, pole: complex) -> Real:
    """Return the whitened response to each real number of a residue, (n_rows, 2 n m)."""
    lines = record.lines
    frequencies = lines.frequencies[::LINE_STEP]
    force = lines.force_here[::LINE_STEP]
    s = 2j * np.pi * frequencies
    up, down = 1 / (s - pole), 1 / (s - np.conj(pole))
    kinematic = lines.kinematic[::LINE_STEP]
    white = record.white[::LINE_STEP] * kinematic[:, None, :]
    n, m = record.through.shape[1:]
    result = np.empty((len(s), white.shape[1], 2, n, m), dtype=complex)
    for part, factor in enumerate((up + down, 1j * (up - down))):
        result[:, :, part] = white[:, :, :, None] * (factor[:, None] * force)[:, None, None, :]
    flat = result.reshape(len(s) * white.shape[1], -1)
    return np.concatenate([flat.real, flat.imag])


MODE_STEPS = 12  # most steps of the fit of a further mode

# A cause with less than the share HOPELESS of the best gain is not fitted again from the nominal model, if the best
# gain is more than CLEAR_LEAD times the least gain. Such a cause may be chosen in the next round.
HOPELESS, CLEAR_LEAD = 0.1, 10.0


def linear_candidates(
    lines: list[WindowedSpectrum],
    current: Fit,
    chains: list[ScreenedChain],
    mode: ScreenedMode | None,
    settings: ScreeningSettings,
    least: float,
) -> list[Proposal[Fit]]:
    """Fit the most promising linear causes.

    If the modes are implausible and there is no law, a further mode is also searched for with the nominal modes, as a
    refitted mode may have moved to the frequency of the further mode.

    ``mode``: the further mode that would explain most; None if no mode is searched for.
    """
    cost = float(np.log(2 * sum(recording.measured.size for recording in lines)))
    promising = settings.promising_linear * max([chain.gain for chain in chains] + [mode.gain if mode else 0.0, 0.0])
    tasks: list[Callable[[], Proposal[Fit] | None]] = []
    for candidate in chains[: settings.most_linear]:
        if candidate.gain > max(least, candidate.cause.size * cost, promising):
            tasks.append(partial(_with_chain, lines, current, candidate.cause))
    numbers = current.hypothesis.shape.per_mode - 2
    if mode is not None and mode.gain > max(least, numbers * cost, promising):
        tasks.append(partial(_with_mode, lines, current, mode, settings.resolved))
    if mode is not None and not current.hypothesis.laws and modes_are_implausible(current):
        tasks.append(partial(_with_mode_from_belief, lines, current, mode.physics, settings.resolved))
    proposals = [result for result in in_processes(tasks) if result is not None]
    others = [proposal for proposal in proposals if not _adds_mode(proposal)]
    modes = sorted(
        (proposal for proposal in proposals if _adds_mode(proposal)), key=lambda proposal: -proposal.evidence
    )
    if modes_are_implausible(current):
        others = _also_from_belief(
            lines, current, others, max((proposal.evidence for proposal in proposals), default=0.0), least
        )
    # two starts yield the same mode: the better one counts
    return [proposal for proposal in [*others, *modes[:1]] if np.isfinite(proposal.evidence)]


def _also_from_belief(
    lines: list[WindowedSpectrum], current: Fit, proposals: list[Proposal[Fit]], most: float, least: float
) -> list[Proposal[Fit]]:
    """Return each proposal, or a better fit of its cause from the nominal model.

    Proposals with a small gain compared with the best gain ``most`` are not fitted again. A fit that is far worse than
    without the cause has not converged and is always repeated.
    """
    hopeless = HOPELESS * most if most > CLEAR_LEAD * least else -np.inf
    refitted_places = [k for k, proposal in enumerate(proposals) if not -least < proposal.evidence < hopeless]
    fitted = in_processes([partial(_from_belief, lines, current, proposals[k]) for k in refitted_places])
    better = dict(zip(refitted_places, fitted, strict=True))
    return [better.get(k, proposal) for k, proposal in enumerate(proposals)]


def _adds_mode(proposal: Proposal[Fit]) -> bool:
    return isinstance(proposal.fitted.hypothesis.causes[-1].physics, MissingMode)


def _with_chain(lines: list[WindowedSpectrum], current: Fit, cause: Cause) -> Proposal[Fit]:
    fitted = fit(lines, current.hypothesis.with_cause(cause), current.noises)
    return Proposal(reported_name(cause.physics), channel_of(cause), fitted, current.score - fitted.score)


def _from_belief(lines: list[WindowedSpectrum], current: Fit, proposal: Proposal[Fit]) -> Proposal[Fit]:
    """Return the proposal of a linear cause, or a better fit of this cause from the nominal model."""
    cause = proposal.fitted.hypothesis.causes[-1]
    if not isinstance(cause.physics, ChainPhysics):
        return proposal
    fitted = with_chain_from_belief(lines, proposal.fitted)
    return Proposal(proposal.name, channel_of(fitted.hypothesis.causes[-1]), fitted, current.score - fitted.score)


def _with_mode(
    lines: list[WindowedSpectrum], current: Fit, mode: ScreenedMode, resolved: float
) -> Proposal[Fit] | None:
    """Fit a further mode; return None if its bandwidth is below ``resolved``, the spacing of the lines."""
    start = current.hypothesis.with_mode(mode.pole, mode.right, mode.left, mode.physics)
    fitted = fit(lines, start, current.noises, iterations=MODE_STEPS)
    spacing = max(recording.recording.rate / len(recording.window) for recording in lines)
    if not mode.physics.resolved(complex(fitted.hypothesis.model.poles[-1]), spacing, resolved):
        return None
    return Proposal(mode.physics.name, {}, fitted, current.score - fitted.score)


def _with_mode_from_belief(
    lines: list[WindowedSpectrum], current: Fit, physics: MissingMode, resolved: float
) -> Proposal[Fit] | None:
    """Fit the mode that explains most in addition to the nominal modes."""
    lab = fit(lines, at_nominal_modes(current.hypothesis), iterations=0)
    if not np.isfinite(lab.score):
        return None
    proposal = _with_mode(lines, lab, find_mode(noise_floor(lab, lines), lab.hypothesis, physics), resolved)
    return None if proposal is None else replace(proposal, evidence=current.score - proposal.fitted.score)


def transducers_of(
    lines: list[WindowedSpectrum], current: Fit, mode: Proposal[Fit], causes: Iterable[Physics]
) -> list[Proposal[Fit]]:
    """Fit the resonance of a transducer, and couplings to it, to the channel in which an added mode is strongest.

    A resonance behind the structure, in one channel, looks like a mode with a motion in that channel alone.
    """
    model = mode.fitted.hypothesis.model
    pole, motion = complex(model.poles[-1]), np.abs(model.right[-1])
    channel = model.responses[int(np.argmax(motion))]
    resonance = np.array([1 / abs(pole) ** 2, -2 * pole.real / abs(pole) ** 2])
    tasks = []
    for physics in causes:
        if not isinstance(physics, TransducerResonance):
            continue
        for place in physics.places(model):
            if place.removeprefix("response ").split(" from ")[0] == channel:
                start = np.append(resonance, physics.start(model)[2:])
                tasks.append(partial(_with_chain, lines, current, Cause(physics, start, place)))
    return [proposal for proposal in in_processes(tasks) if np.isfinite(proposal.evidence)]


def channel_of(cause: Cause) -> dict[str, Any]:
    """Return the location of a linear cause for a diagnosis."""
    if isinstance(cause.physics, AcCoupling):
        return {"form": cause.place or "one stage"}
    kind, _, label = cause.place.partition(" ")
    if kind not in ("response", "force"):
        return {}
    channel, _, source = label.partition(" from ")
    return {"channel": channel, "role": kind} | ({"from": source} if source else {})


@dataclass(frozen=True)
class Gains:
    """Gain in misfit of a further cause."""

    fixed_form: float  # gain if the laws keep their form
    free_form: float

    def is_independent(self, needed: float, min_share: float) -> bool:
        """Return whether the gain with laws of free form is at least ``needed`` and a large share of the other gain.

        The least share of the gain with laws of fixed form is ``min_share``.

        Examples
        --------
        >>> Gains(5000.0, 2900.0).is_independent(1200.0, 0.33), Gains(5000.0, 1300.0).is_independent(1200.0, 0.33)
        (True, False)
        """
        return self.free_form >= max(needed, min_share * self.fixed_form)


def gains_with_laws(lines: list[WindowedSpectrum], current: Fit, causes: Sequence[Cause]) -> list[Gains]:
    """Return the gain of each cause in addition to the accepted laws, once with their fixed form and once in free form.

    For a linear cause, the free form has shapes of all families. For a law, it has only shapes that may correct the
    family of each accepted law: what a spring explains in addition to friction of any form is not friction.
    """
    if not causes:
        return []
    kinds = ["" if isinstance(cause.physics, JointPhysics) else ALL_FAMILIES for cause in causes]
    fixed_floor = noise_floor(current, lines)
    free = {kind: replace(current, hypothesis=with_free_forms(current.hypothesis, kind)) for kind in kinds}
    floors = {kind: noise_floor(fitted, lines) for kind, fitted in free.items()}
    return [
        Gains(_gain(fixed_floor, current, cause), _gain(floors[kind], free[kind], cause))
        for cause, kind in zip(causes, kinds, strict=True)
    ]


def _gain(floor: Floor, fitted: Fit, cause: Cause) -> float:
    """Return the screened gain in misfit of a cause; all fitted numbers are adapted to first order."""
    physics = cause.physics
    if isinstance(physics, ChainPhysics):
        absent = Cause(physics, physics.start(fitted.hypothesis.shape.nominal), cause.place)
        return gain_of_chain(floor, fitted.hypothesis, absent)
    if isinstance(physics, MissingMode):
        return find_mode(floor, fitted.hypothesis, physics).gain
    assert isinstance(physics, JointPhysics)
    assert cause.axis is not None
    screened = screen_joints(floor, fitted.hypothesis, cause.axis, [physics])
    return screened[0].gain if screened else 0.0
