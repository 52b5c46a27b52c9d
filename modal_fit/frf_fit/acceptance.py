"""Statistical acceptance of a mode: its trial fit, and the reasons to reject it."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Real

from ..settings import SETTINGS
from ..shapes import modal_assurance
from .candidates import Candidate
from .elimination import Elimination, Modes, eliminate, mode_power, out_of_band_power, participation, without_modes
from .measured_lines import MeasuredLines, half_power_lines, lines_around, peak_rise
from .refinement import refine


@dataclass(frozen=True)
class Trial:
    """Fits of the lines around a candidate, without and with the candidate as a mode."""

    lines: MeasuredLines  # lines of the neighbourhood without the far modes
    before: Elimination  # fit without the mode
    after: Elimination  # fit with the mode
    modes: Modes  # the near modes; the mode under test is the last
    far_power: Real  # (n_lines,): power of the far modes on each line
    measured: MeasuredLines  # all lines of the band with all modes


@dataclass(frozen=True)
class TrialResult:
    """Decision on a candidate, and the modes refined together with it."""

    reason: str  # reason to reject the candidate; empty where it is accepted
    modes: Modes  # the modes of the neighbourhood with the candidate last, refined there
    near: NDArray[np.bool_]  # (n_modes,): whether each earlier mode was refined with the candidate


def try_candidate(candidate: Candidate, modes: Modes, elimination: Elimination, lines: MeasuredLines) -> TrialResult:
    """Fit the neighbourhood without and with a candidate and test the difference.

    Where the residual with the candidate is noise, Schwarz's criterion alone decides. Where the residual is more than
    noise (shifts between set-ups, leakage, nonlinearity), errors have the shape of resonances, and a second mode next
    to a strong one always lowers the misfit. A candidate must then be found in many orders, remove most of a misfit
    that no error of the other modes explains, unless it stands at a peak of its own; and no single mode may explain
    it together with its neighbour.
    """
    local, near, far_power = _neighbourhood(candidate, modes, elimination, lines)
    near_modes = modes.chosen(near)
    if candidate.order_share < SETTINGS.unstable_candidate and (
        reason := _small_residual(candidate, near_modes, eliminate(near_modes, local), local, far_power)
    ):
        return TrialResult(reason, modes, near)  # saves the refinements
    before = refine(near_modes, local, SETTINGS.trial_effort)
    left = participation(candidate.pole, local, before.elimination)
    start = before.modes.joined(Modes(np.array([candidate.pole]), left))
    after = refine(start, local, SETTINGS.trial_effort)
    trial = Trial(local, before.elimination, after.elimination, after.modes, far_power, lines)
    return TrialResult(_moved_away(candidate, trial) or _unneeded(candidate, trial), after.modes, near)


def reject_early(candidate: Candidate, modes: Modes, elimination: Elimination, lines: MeasuredLines) -> str:
    """Test whether the last of several modes that start together is needed; return the reason to drop it, or "".

    This test is used for lines with a covariance. Other modes may still be missing, so that a misfit beyond the noise
    is no argument against the last mode. The mode is dropped where the fit is as good without it, or where it overlaps
    another mode, the residual is more than noise, and one mode explains both.
    """
    others, _, fixed = _trial_of_last(candidate, modes, elimination, lines)
    isolated = _isolated(fixed.modes, SETTINGS.overlapping)
    if isolated and not _as_good_without(fixed):
        return ""
    trial, _ = _refined_trial(others, fixed)
    if reason := _as_good_without(trial):
        return reason
    if isolated or _residual_test(trial)[2] or _is_column_at_peak(candidate, trial):
        return ""
    return _alike_without_peak(trial)


def reject_again(
    candidate: Candidate, modes: Modes, elimination: Elimination, lines: MeasuredLines, *, thorough: bool
) -> str:
    """Test the last mode against a fit without it; return the reason to drop the mode, or "".

    The mode is first tested with fixed poles. If it passes, it stays; with ``thorough`` only if it is isolated.
    Otherwise the near modes are refined with and without it, and the test is repeated. A mode that overlaps no other
    mode also stays where the misfit of the whole band doubles without it.
    """
    others, near, fixed = _trial_of_last(candidate, modes, elimination, lines)
    if not _unneeded(candidate, fixed) and (not thorough or _isolated(fixed.modes, 2 * SETTINGS.near_mode)):
        return ""
    trial, before = _refined_trial(others, fixed)
    reason = _unneeded(candidate, trial)
    if not reason or not _isolated(fixed.modes, SETTINGS.overlapping):
        return reason
    without = modes.chosen(np.s_[:-1]).chosen(~near).joined(before)
    return reason if eliminate(without, lines).cost < SETTINGS.misfit_without_mode * elimination.cost else ""


def _trial_of_last(
    candidate: Candidate, modes: Modes, elimination: Elimination, lines: MeasuredLines
) -> tuple[Modes, NDArray[np.bool_], Trial]:
    """Fit the lines around the last mode, without and with it, at fixed poles.

    Also return the other near modes, and which of the other modes are near.
    """
    pole = complex(modes.poles[-1])
    others, last = modes.chosen(np.s_[:-1]), modes.chosen(np.s_[-1:])
    local, near, far_power = _neighbourhood(replace(candidate, pole=pole), others, elimination, lines)
    near_modes = others.chosen(near)
    together = near_modes.joined(last)
    return (
        near_modes,
        near,
        Trial(local, eliminate(near_modes, local), eliminate(together, local), together, far_power, lines),
    )


def _refined_trial(others: Modes, fixed: Trial) -> tuple[Trial, Modes]:
    """Return the trial with all near modes refined, and the near modes refined without the last one."""
    before = refine(others, fixed.lines, SETTINGS.trial_effort)
    after = refine(fixed.modes, fixed.lines, SETTINGS.trial_effort)
    return Trial(
        fixed.lines, before.elimination, after.elimination, after.modes, fixed.far_power, fixed.measured
    ), before.modes


def _neighbourhood(
    candidate: Candidate, modes: Modes, elimination: Elimination, lines: MeasuredLines
) -> tuple[MeasuredLines, NDArray[np.bool_], Real]:
    """Return the lines around a candidate without the far modes.

    Also return which modes are near, and the power of the far modes on these lines.
    """
    chosen = lines_around(candidate.frequency, candidate.damping_ratio, lines)
    reach = np.ptp(lines.frequencies[chosen]) / 2
    near = np.abs(modes.frequencies - candidate.frequency) <= reach
    far, right = modes.chosen(~near), elimination.right[: len(modes.poles)][~near]
    local = without_modes(lines, far, right).subset(chosen)
    return local, near, mode_power(far, right, lines).sum(axis=1)[chosen]


def _unneeded(candidate: Candidate, trial: Trial) -> str:
    """Return the reason why the data do not need the candidate; empty where they do."""
    if reason := _as_good_without(trial):
        return reason
    share, gain, is_noise = _residual_test(trial)
    has_shape = trial.lines.values[0].size > 1  # a single FRF does not tell a weak mode from an error of a strong one
    explained = has_shape and (is_noise or gain > SETTINGS.certain_gain)
    if not explained and not _is_column_at_peak(candidate, trial):
        reason = _small_gain(candidate, share, gain) or _alike_without_peak(trial)
    return reason or _one_mode_explains_both(trial)


def _small_gain(candidate: Candidate, share: float, gain: float) -> str:
    """Return a reason where errors of the other modes may explain what the candidate explains, else an empty text."""
    if share < SETTINGS.needed_share:
        return f"it explains {100 * share:.0f} % of its neighbourhood, as errors of the other modes would"
    if candidate.order_share < SETTINGS.steady_candidate and share < SETTINGS.needed_share_of_few_orders:
        return f"found in only {100 * candidate.order_share:.0f} % of the orders, and the misfit is more than noise"
    if gain < SETTINGS.least_gain:
        return f"the misfit around it falls by a factor of {gain:.1f} only, and stays more than noise"
    return ""


def _is_column_at_peak(candidate: Candidate, trial: Trial) -> bool:
    """Return whether most orders have the candidate, at a peak that errors of the other modes cannot make."""
    if candidate.order_share < SETTINGS.steady_candidate:
        return False
    return _has_peak(trial, len(trial.modes.poles) - 1)


def _has_peak(trial: Trial, number: int) -> bool:
    """Return whether a near mode stands at a peak that errors of others cannot make, outside their half-power bands."""
    poles, lines = trial.modes.poles, trial.measured
    own = half_power_lines(complex(poles[number]), lines)
    for pole in np.delete(poles, number):
        own &= ~half_power_lines(complex(pole), lines)
    return peak_rise(complex(poles[number]), own, lines) > 1 + SETTINGS.needed_share


def _as_good_without(trial: Trial) -> str:
    """Return a reason where, by Schwarz's criterion, the fit is as good without the mode; else an empty text."""
    lines = trial.lines
    n_unknowns = 2 * (lines.values.shape[2] + lines.drive.shape[2])
    rounding = SETTINGS.rounding_power * float(np.mean(np.abs(lines.values) ** 2))
    variance = max(trial.after.cost / lines.n_values, _variance_at_mode(trial), rounding)
    if lines.has_covariance:
        variance = max(variance, float(lines.noise.sum()) / lines.n_values)
    # correlated residuals are fewer independent values
    correlation = max(trial.after.autocorrelation(lines, np.ones(len(lines.s), dtype=bool)), 0.0)
    penalty = n_unknowns * float(np.log(lines.n_values)) * max(1 + 2 * correlation, lines.correlation)
    return "the fit is as good without it" if trial.before.cost - trial.after.cost < penalty * variance else ""


def _variance_at_mode(trial: Trial) -> float:
    """Return the mean squared residual of a real value, weighted by the power of the last mode on each line.

    The noise may follow the level of the FRF, as with few averages. A mode must then exceed the noise at its resonance,
    and not the mean noise of the neighbourhood.
    """
    own = mode_power(trial.modes, trial.after.right, trial.lines)[:, -1]
    per_line = trial.lines.n_values / len(own)
    return float(own @ trial.after.power(trial.lines) / max(own.sum(), 1e-300)) / per_line


def _residual_test(trial: Trial) -> tuple[float, float, bool]:
    """Return share and gain at the near mode that needs the candidate most, and whether the residual is noise.

    ``share`` is the residual without the candidate over the size of all modes on the lines of that near mode; ``gain``
    is the factor by which the candidate lowers the squared residual there. All near modes are examined, because the fit
    without the candidate may lie on either of two close modes.
    """
    modes, lines = trial.modes, trial.lines
    size = mode_power(modes, trial.after.right, lines).sum(axis=1) + out_of_band_power(trial.after, lines)
    size = size + trial.far_power
    before, after = trial.before.power(lines), trial.after.power(lines)
    best = (0.0, 1.0)
    for number in np.flatnonzero(_near_last(modes, 4 * lines.spacing)):
        band = half_power_lines(complex(modes.poles[number]), lines)
        if band.any():
            share = float(np.sqrt(before[band].sum() / max(size[band].sum(), 1e-300)))
            best = max(best, (share, float(before[band].sum() / max(after[band].sum(), 1e-300))))
    return *best, _is_noise(trial, after)


def _near_last(modes: Modes, least: float = 0.0) -> NDArray[np.bool_]:
    """Return whether each mode is so near to the last one that their errors overlap, or nearer than ``least`` (Hz)."""
    width = modes.frequencies * modes.damping_ratios
    distance = np.abs(modes.frequencies - modes.frequencies[-1])
    return np.asarray(distance <= np.maximum(SETTINGS.error_reach * (width + width[-1]), least))


def _is_noise(trial: Trial, power: Real) -> bool:
    """Return whether the residual with the candidate is noise: as low as expected, or uncorrelated over the lines.

    The level is that in the half-power band. The correlation is that of all lines of the neighbourhood: a measured
    resonance that is no exact modal sum can be described by several modes, each of which only improves a few lines.
    """
    lines = trial.lines
    own = half_power_lines(complex(trial.modes.poles[-1]), lines)
    if not own.any():
        own = np.ones(len(power), dtype=bool)
    if power[own].sum() < SETTINGS.noise_misfit * lines.noise[own].sum():
        return True
    width = (trial.modes.frequencies * trial.modes.damping_ratios)[_near_last(trial.modes)]
    if width.min() < SETTINGS.resolved_lines * lines.spacing:  # errors of a narrow mode look like noise
        return False
    return trial.after.autocorrelation(lines, np.ones(len(power), dtype=bool)) < SETTINGS.white_correlation


def _alike_without_peak(trial: Trial) -> str:
    """Return a reason where the last mode has no peak, but the vectors of a near mode that is stronger or has one."""
    modes, right = trial.modes, trial.after.right
    product = modal_assurance(right[[-1]], right)[0] * modal_assurance(modes.left[[-1]], modes.left)[0]
    near, stronger = _near_and_stronger(trial)
    for other in np.flatnonzero(near & (product > SETTINGS.alike_assurance)):
        if stronger[other] or _has_peak(trial, int(other)):
            return f"it has no peak of its own, and the shape of {modes.frequencies[other]:.4g} Hz beside it"
    return ""


def _one_mode_explains_both(trial: Trial) -> str:
    """Return a reason where one mode explains the last mode and those that it overlaps, else an empty text.

    The one mode may have another pole and left vector in each response, as where a structure changes from set-up to
    set-up. There are more modes only where their misfit with common poles is smaller, by more than Schwarz's criterion
    asks for the unknowns that they have more.
    """
    near = np.logical_and(*_near_and_stronger(trial))
    n_responses = trial.lines.values.shape[2]
    if n_responses == 1 or not near.any():
        return ""
    modes = trial.modes
    width = modes.frequencies * modes.damping_ratios
    distance = np.abs(modes.frequencies - modes.frequencies[-1])
    nearest = int(np.argmin(np.where(near, distance, np.inf)))
    replaced = distance < SETTINGS.overlapping * (width + width[-1])  # the last mode itself, too
    replaced[nearest] = True
    lines = without_modes(trial.lines, modes.chosen(~replaced), trial.after.right[~replaced])
    starts = modes.chosen(np.arange(len(width)) == nearest), modes.chosen(np.s_[-1:])
    misfit = sum(_least_misfit(starts, lines, response) for response in range(n_responses))
    n_excitations = lines.drive.shape[2]
    several = 2 * replaced.sum() * (n_responses + n_excitations)  # unknowns: right vectors; poles and left vectors
    extra = max(int(several) - 2 * n_responses * (1 + n_excitations), 0)
    if misfit - trial.after.cost > extra * np.log(lines.n_values) * trial.after.cost / lines.n_values:
        return ""
    return f"one mode whose pole changes from response to response explains it and {modes.frequencies[nearest]:.4g} Hz"


def _near_and_stronger(trial: Trial) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which other modes are near the last one, and which have a higher peak in the sum of all responses."""
    modes = trial.modes
    width = modes.frequencies * modes.damping_ratios
    near = np.abs(modes.frequencies - modes.frequencies[-1]) < SETTINGS.near_mode * (width + width[-1])
    near[-1] = False
    power = mode_power(modes, trial.after.right, trial.lines).max(axis=0)
    return near, power > power[-1]


def _least_misfit(starts: tuple[Modes, ...], lines: MeasuredLines, response: int) -> float:
    """Return the least squared misfit of one response by one mode, from the better of the ``starts``."""
    own = replace(lines, values=lines.values[:, :, [response]])
    start = min(starts, key=lambda modes: eliminate(modes, own).cost)
    return refine(start, own, SETTINGS.trial_effort).elimination.cost


def _isolated(modes: Modes, reach: float) -> bool:
    """Return whether all other modes are further from the last mode than ``reach`` times their summed half widths.

    The half width is half of the bandwidth, damping ratio times frequency.
    """
    width = modes.frequencies * modes.damping_ratios
    distance = np.abs(modes.frequencies - modes.frequencies[-1])[:-1]
    return bool(np.all(distance > reach * (width[:-1] + width[-1])))


def _small_residual(
    candidate: Candidate, modes: Modes, elimination: Elimination, lines: MeasuredLines, far_power: Real
) -> str:
    """Return a reason to reject a candidate without a trial, as the residual around it is small; else an empty text."""
    bands = [half_power_lines(pole, lines) for pole in (candidate.pole, *modes.poles)]
    together = np.any(bands, axis=0)
    power = elimination.power(lines)
    if power[together].sum() < SETTINGS.noise_misfit * lines.noise[together].sum():
        return ""
    size = mode_power(modes, elimination.right, lines).sum(axis=1) + out_of_band_power(elimination, lines) + far_power
    shares = [np.sqrt(power[band].sum() / max(size[band].sum(), 1e-300)) for band in bands if band.any()]
    if not shares:  # all are outside the lines
        return ""
    largest = float(max(shares))
    if largest < SETTINGS.needed_share:
        return f"only {100 * largest:.0f} % are left around it, as errors of the other modes would leave"
    return ""


def _moved_away(candidate: Candidate, trial: Trial) -> str:
    """Return a reason where the refined pole is no longer near the candidate, else an empty text."""
    pole = complex(trial.modes.poles[-1])
    frequency, damping = abs(pole) / (2 * np.pi), -pole.real / abs(pole)
    low, high = trial.lines.band
    if not low < frequency < high:
        return "refinement drives it out of the band"
    if damping > SETTINGS.largest_damping:
        return f"refinement makes it no vibration (damping ratio {damping:.2f})"
    reach = max(3 * abs(candidate.pole.real), 6 * np.pi * trial.lines.spacing)
    if abs(pole - candidate.pole) > reach:
        return f"refinement drives it from {candidate.frequency:.4g} to {frequency:.4g} Hz"
    return ""
