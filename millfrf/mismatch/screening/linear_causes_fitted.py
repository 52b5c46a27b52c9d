"""Linear causes fitted in one round of the search."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimation import WindowedSpectrum
from millfrf.core import Complex, Real

from ..inference.process_pool import in_processes
from ..inference.search import Proposal
from ..inference.settings import ScreeningSettings
from ..models.fitting import Fit, fit, modes_are_odd
from ..models.hypothesis import Cause, Hypothesis
from ..models.model_terms import EVERYTHING, with_free_forms
from ..models.refinement import believed, with_chain_from_belief
from ..physics.protocol import ChainPhysics, FormedPhysics, JointPhysics, ModePhysics, answer_name
from .score_tests import ScreenedChain, gain_of_chain, screen_joints
from .whitened_residual import Floor, FloorRecord, noise_floor

DAMPINGS = (0.015, 0.05)
FREQUENCIES = 48
EVERY = 3
"""Step between the lines that the scan takes; the scan needs no precision."""


@dataclass(frozen=True)
class SightedMode:
    """A further pole with a residue of rank one, and the misfit that it would gain.

    Parameters
    ----------
    physics
        The cause that adds it.
    pole
        Its pole, rad/s.
    right : (n_responses,)
        Right vector of the residue ``right left^T``, m/(N s).
    left : (n_excitations,)
        Left vector of that residue.
    gain
        Misfit that it would gain.
    """

    physics: ModePhysics
    pole: complex
    right: Complex
    left: Complex
    gain: float


def find_mode(floor: Floor, hypothesis: Hypothesis, physics: ModePhysics) -> SightedMode:
    """The pole and residue that explain most of the residual.

    For poles over the band a residue of full rank is fitted by linear least squares after the modal parameters have
    adapted; the best is brought to rank one by its singular value decomposition.
    """
    low = min(record.lines.frequencies[0] for record in floor.records)
    high = max(record.lines.frequencies[-1] for record in floor.records)
    best: tuple[float, complex, Real] | None = None
    thin = _thinned(floor, hypothesis)
    for frequency in np.geomspace(1.3 * low, 0.95 * high, FREQUENCIES):
        for damping in DAMPINGS:
            pole = 2 * np.pi * frequency * (-damping + 1j * np.sqrt(1 - damping**2))
            gain, residue = _residue(thin, pole)
            if best is None or gain > best[0]:
                best = gain, pole, residue
    assert best is not None
    gain, pole, numbers = best
    n, m = floor.records[0].through.shape[1:]
    parts = numbers.reshape(2, n, m)
    u, s, vh = np.linalg.svd(parts[0] + 1j * parts[1])
    scale = np.sqrt(s[0] * np.linalg.norm(hypothesis.model.left) / np.linalg.norm(hypothesis.model.right))
    return SightedMode(physics, pole, u[:, 0] * s[0] / scale, vh[0] * scale, gain * s[0] ** 2 / np.sum(s**2))


@dataclass(frozen=True)
class _Thin:
    """Every few lines of a floor: derivative and residual of each recording, and their own normal equations."""

    records: tuple[tuple[FloorRecord, Real, Real], ...]
    inverse: Real
    gradient: Real


def _thinned(floor: Floor, hypothesis: Hypothesis) -> _Thin:
    size = len(floor.gradient)
    matrix, gradient = np.diag(np.full(size, 1e-6)), np.zeros(size)
    shape = hypothesis.shape
    matrix[np.arange(shape.size), np.arange(shape.size)] = shape.belief
    gradient[: shape.size] = -shape.belief * hypothesis.u
    records = []
    for record in floor.records:
        chosen = _chosen(record)
        slope, rest = record.slope[chosen], record.rest[chosen]
        matrix += 2 * EVERY * slope.T @ slope
        gradient += 2 * EVERY * slope.T @ rest
        records.append((record, slope, rest))
    return _Thin(tuple(records), np.asarray(np.linalg.inv(matrix), dtype=float), gradient)


def _residue(thin: _Thin, pole: complex) -> tuple[float, Real]:
    """Gain and residue numbers (real parts, then imaginary parts) of a pole."""
    through = thin.records[0][0].through
    count = 2 * through.shape[1] * through.shape[2]
    own, shared, pull = np.zeros((count, count)), np.zeros((len(thin.gradient), count)), np.zeros(count)
    for record, slope, rest in thin.records:
        columns = _columns(record, pole)
        own += 2 * EVERY * columns.T @ columns
        shared += 2 * EVERY * slope.T @ columns
        pull += 2 * EVERY * columns.T @ rest
    solved = thin.inverse @ shared
    left, drive = own - shared.T @ solved, pull - solved.T @ thin.gradient
    answer = np.asarray(np.linalg.lstsq(left, drive, rcond=1e-8)[0], dtype=float)
    return float(drive @ answer), answer


def _chosen(record: FloorRecord) -> NDArray[np.int64]:
    """Rows of the real system that belong to every EVERYth line."""
    n_lines, n = record.residual.shape
    rows = (np.arange(0, n_lines, EVERY)[:, None] * n + np.arange(n)).ravel()
    return np.concatenate([rows, rows + n_lines * n])


def _columns(record: FloorRecord, pole: complex) -> Real:
    """Whitened response to each real number of a residue, (n_rows, 2 n m)."""
    lines = record.lines
    frequencies = lines.frequencies[::EVERY]
    force = lines.force_here[::EVERY]
    s = 2j * np.pi * frequencies
    up, down = 1 / (s - pole), 1 / (s - np.conj(pole))
    kinematic = lines.kinematic[::EVERY]
    white = record.white[::EVERY] * kinematic[:, None, :]
    n, m = record.through.shape[1:]
    result = np.empty((len(s), white.shape[1], 2, n, m), dtype=complex)
    for part, factor in enumerate((up + down, 1j * (up - down))):
        result[:, :, part] = white[:, :, :, None] * (factor[:, None] * force)[:, None, None, :]
    flat = result.reshape(len(s) * white.shape[1], -1)
    return np.concatenate([flat.real, flat.imag])


MODE_STEPS = 12
"""Steps at most of the fit of a further mode."""

BEHIND, CLEAR_LEAD = 0.1, 10.0
"""Share of the best cause's gain below which another is not fitted from the lab's model, too, and gain of the best one
from which that counts, over the least gain. It comes next where the best one leaves it anything."""


def linear_candidates(
    lines: list[WindowedSpectrum],
    current: Fit,
    chains: list[ScreenedChain],
    mode: SightedMode | None,
    settings: ScreeningSettings,
    least: float,
) -> list[Proposal[Fit]]:
    """Fit the linear causes that promise most.

    Where the modes look odd and no law moves them, a further mode is also sought from the lab's own: one of them may
    have gone to where the further one is.

    Parameters
    ----------
    lines
        Windowed spectra of the recordings that are compared.
    current
        The fit without them.
    chains
        Linear causes at their places as they were screened, best first.
    mode
        The further mode that would explain most; None: none is looked for.
    settings
        Thresholds of what is fitted.
    least
        Screened gain from which anything is fitted.
    """
    cost = float(np.log(2 * sum(one.measured.size for one in lines)))
    promising = settings.promising_linear * max([one.gain for one in chains] + [mode.gain if mode else 0.0, 0.0])
    tasks: list[Callable[[], Proposal[Fit] | None]] = []
    for one in chains[: settings.most_linear]:
        if one.gain > max(least, one.cause.size * cost, promising):
            tasks.append(partial(_with_chain, lines, current, one.cause))
    numbers = current.hypothesis.shape.per_mode - 2
    if mode is not None and mode.gain > max(least, numbers * cost, promising):
        tasks.append(partial(_with_mode, lines, current, mode, settings.resolved))
    if mode is not None and not current.hypothesis.laws and modes_are_odd(current):
        tasks.append(partial(_with_mode_from_belief, lines, current, mode.physics, settings.resolved))
    found = [one for one in in_processes(tasks) if one is not None]
    others = [one for one in found if not _adds_mode(one)]
    modes = sorted((one for one in found if _adds_mode(one)), key=lambda one: -one.evidence)
    if modes_are_odd(current):
        others = _also_from_belief(lines, current, others, max((one.evidence for one in found), default=0.0), least)
    # of one mode from two beginnings the better counts
    return [one for one in [*others, *modes[:1]] if np.isfinite(one.evidence)]


def _also_from_belief(
    lines: list[WindowedSpectrum], current: Fit, found: list[Proposal[Fit]], most: float, least: float
) -> list[Proposal[Fit]]:
    """Causes of chains, each as it was fitted or from the lab's own model; those far behind as they were fitted.

    A fit that ends far worse than the one without the cause is lost, and says nothing of the cause.
    """
    hopeless = BEHIND * most if most > CLEAR_LEAD * least else -np.inf
    again = [k for k, one in enumerate(found) if not -least < one.evidence < hopeless]
    fitted = in_processes([partial(_from_belief, lines, current, found[k]) for k in again])
    better = dict(zip(again, fitted, strict=True))
    return [better.get(k, one) for k, one in enumerate(found)]


def _adds_mode(proposal: Proposal[Fit]) -> bool:
    return isinstance(proposal.fitted.hypothesis.causes[-1].physics, ModePhysics)


def _with_chain(lines: list[WindowedSpectrum], current: Fit, cause: Cause) -> Proposal[Fit]:
    fitted = fit(lines, current.hypothesis.with_cause(cause), current.noises)
    return Proposal(answer_name(cause.physics), channel_of(cause), fitted, current.score - fitted.score)


def _from_belief(lines: list[WindowedSpectrum], current: Fit, one: Proposal[Fit]) -> Proposal[Fit]:
    """A linear cause, or a better fit of it from the lab's own model."""
    cause = one.fitted.hypothesis.causes[-1]
    if not isinstance(cause.physics, ChainPhysics):
        return one
    fitted = with_chain_from_belief(lines, one.fitted)
    return Proposal(one.name, channel_of(fitted.hypothesis.causes[-1]), fitted, current.score - fitted.score)


def _with_mode(lines: list[WindowedSpectrum], current: Fit, mode: SightedMode, resolved: float) -> Proposal[Fit] | None:
    """The mode fitted; None where it is no wider than the lines of a record."""
    start = current.hypothesis.with_mode(mode.pole, mode.right, mode.left, mode.physics)
    fitted = fit(lines, start, current.noises, iterations=MODE_STEPS)
    spacing = max(one.recording.rate / len(one.window) for one in lines)
    if not mode.physics.resolved(complex(fitted.hypothesis.model.poles[-1]), spacing, resolved):
        return None
    return Proposal(mode.physics.name, {}, fitted, current.score - fitted.score)


def _with_mode_from_belief(
    lines: list[WindowedSpectrum], current: Fit, physics: ModePhysics, resolved: float
) -> Proposal[Fit] | None:
    """The mode that would explain most beside the lab's own modes, fitted."""
    lab = fit(lines, believed(current.hypothesis), iterations=0)
    if not np.isfinite(lab.score):
        return None
    found = _with_mode(lines, lab, find_mode(noise_floor(lab, lines), lab.hypothesis, physics), resolved)
    return None if found is None else replace(found, evidence=current.score - found.fitted.score)


def channel_of(cause: Cause) -> dict[str, Any]:
    """Location of a linear cause, as a diagnosis states it."""
    if isinstance(cause.physics, FormedPhysics):
        return {"form": cause.place or "one stage"}
    kind, _, label = cause.place.partition(" ")
    return {"channel": label, "role": kind} if kind in ("response", "force") else {}


@dataclass(frozen=True)
class Gains:
    """What a further cause would gain in misfit.

    Parameters
    ----------
    held
        Beside the laws as they are.
    free
        Beside the same laws in any form.
    """

    held: float
    free: float

    def own(self, needed: float, kept: float) -> bool:
        """Whether a cause gains enough beside laws of any form, and keeps enough of what it gains beside these.

        Parameters
        ----------
        needed
            Gain that is enough.
        kept
            Share that is enough of the gain beside the laws as they are.

        Examples
        --------
        >>> Gains(5000.0, 2900.0).own(1200.0, 0.33), Gains(5000.0, 1300.0).own(1200.0, 0.33)
        (True, False)
        """
        return self.free >= max(needed, kept * self.held)


def gains_beside_laws(lines: list[WindowedSpectrum], current: Fit, causes: Sequence[Cause]) -> list[Gains]:
    """Gain of one more cause beside laws as they are, and in any form, for each of several causes.

    Laws may be mended by all shapes where the cause is linear. Where it is a law itself, they may be mended by shapes
    of their own family alone: what a spring explains beside friction in any form is no friction.

    Parameters
    ----------
    lines
        Windowed spectra of the recordings that are compared.
    current
        A fit with at least one law of a joint, without the causes.
    causes
        Further causes, each on its own.
    """
    if not causes:
        return []
    kinds = ["" if isinstance(one.physics, JointPhysics) else EVERYTHING for one in causes]
    held = noise_floor(current, lines)
    free = {kind: replace(current, hypothesis=with_free_forms(current.hypothesis, kind)) for kind in kinds}
    floors = {kind: noise_floor(one, lines) for kind, one in free.items()}
    return [
        Gains(_gain(held, current, one), _gain(floors[kind], free[kind], one))
        for one, kind in zip(causes, kinds, strict=True)
    ]


def _gain(floor: Floor, fitted: Fit, cause: Cause) -> float:
    """Gain of a cause in misfit, everything that is fitted adapting."""
    physics = cause.physics
    if isinstance(physics, ChainPhysics):
        absent = Cause(physics, physics.start(fitted.hypothesis.shape.nominal), cause.place)
        return gain_of_chain(floor, fitted.hypothesis, absent)
    if isinstance(physics, ModePhysics):
        return find_mode(floor, fitted.hypothesis, physics).gain
    assert isinstance(physics, JointPhysics)
    assert cause.axis is not None
    screened = screen_joints(floor, fitted.hypothesis, cause.axis, [physics])
    return screened[0].gain if screened else 0.0
