"""Whether the data need a mode: what a fit of its neighbourhood without it misses, against noise and against errors."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...models import modal_assurance
from ..variable_projection import Elimination, MeasuredLines, Modes, Real, half_power_lines, mode_power, outside_power
from .steady_poles import Candidate

CLEAN = 2.0  # misfit over the noise expected up to which noise alone decides
_WHITE = 0.35  # correlation of neighbouring lines' errors up to which they are noise, whatever its level
_RESOLVED = 3.0  # lines in half a bandwidth from which on errors of a model are smooth over the lines
_REACH = 4.0  # sums of half bandwidths
_COLOUR_LINES = 12  # to each side, that the correlation is taken over
NEEDED = 0.2  # misfit over the modes' own size that a missing mode leaves, where more than noise is left
_PLAIN = 0.6  # the same, where a candidate is taken although few orders have it
_STEADY = 0.5  # share of the orders that a candidate needs where more than noise is left
_GAIN = 1.5  # factor by which the misfit around the pole must fall there
_PLAINLY = 300.0  # the same, from which errors of the other modes cannot be what the candidate explains
_ALIKE = 0.6  # product of both vectors' modal assurance from which two near modes are one
NEAR = 3.0  # sums of half bandwidths within which two modes may be one
_ROUNDING = 1e-14  # share of the power below which a misfit is rounding


@dataclass(frozen=True)
class Trial:
    """Neighbourhood without and with a mode.

    Parameters
    ----------
    lines
        Lines of the neighbourhood, from which the far modes are subtracted.
    before, after
        Fits without and with the mode.
    modes
        The near modes; the mode in question stands last.
    far_power : (n_lines,)
        Power of the far modes on each line.
    """

    lines: MeasuredLines
    before: Elimination
    after: Elimination
    modes: Modes
    far_power: Real


def unneeded(candidate: Candidate, trial: Trial) -> str:
    """Why the data do not need the candidate; empty where they do."""
    if reason := as_good_without(trial):
        return reason
    share, gain, clean = most_missed(trial)
    if clean or gain > _PLAINLY:
        return ""
    if share < NEEDED:
        return f"it explains {100 * share:.0f} % of its neighbourhood, as errors of the other modes would"
    if candidate.share < _STEADY and share < _PLAIN:
        return f"found in only {100 * candidate.share:.0f} % of the orders, and the misfit is more than noise"
    if gain < _GAIN:
        return f"the misfit around it falls by a factor of {gain:.1f} only, and stays more than noise"
    return copy_of_near_mode(trial)


def as_good_without(trial: Trial) -> str:
    """Schwarz's criterion on the neighbourhood; a reason where the gain is within the penalty, else empty."""
    n_unknowns = 2 * (trial.lines.values.shape[2] + trial.lines.drive.shape[2])
    lines = trial.lines
    exact = _ROUNDING * float(np.mean(np.abs(lines.values) ** 2))
    variance = max(trial.after.cost / lines.n_values, _variance_at_mode(trial), exact)
    if lines.stated:
        variance = max(variance, float(lines.noise.sum()) / lines.n_values)
    memory = max(trial.after.colour(lines, np.ones(len(lines.s), dtype=bool)), 0.0)  # fewer independent values
    penalty = n_unknowns * float(np.log(lines.n_values)) * max(1 + 2 * memory, lines.correlation)
    return "the fit is as good without it" if trial.before.cost - trial.after.cost < penalty * variance else ""


def copy_of_near_mode(trial: Trial) -> str:
    """A reason where the last mode has the vectors of a near one, else empty."""
    alike, other = likeness(trial.modes, trial.after.right, len(trial.modes.poles) - 1)
    if alike > _ALIKE:
        return f"a copy of the mode at {other:.4g} Hz (assurance {alike:.2f}), and the misfit is more than noise"
    return ""


def _variance_at_mode(trial: Trial) -> float:
    """Mean squared misfit of a real value on the lines that the last mode lives from.

    Noise may go with the level of the FRF, as that of few averages does. A mode must then outdo the noise at its
    own resonance, and not the mean over the neighbourhood.
    """
    own = mode_power(trial.modes, trial.after.right, trial.lines)[:, -1]
    per_line = trial.lines.n_values / len(own)
    return float(own @ trial.after.power(trial.lines) / max(own.sum(), 1e-300)) / per_line


def most_missed(trial: Trial) -> tuple[float, float, bool]:
    """Give the near mode whose half-power band misses the candidate most.

    When two modes stand close, the fit without the candidate may sit on either.

    Returns
    -------
    share
        Misfit without the candidate over the size of all modes there.
    gain
        Factor by which the misfit falls.
    clean
        Whether what is left is noise.
    """
    modes, lines = trial.modes, trial.lines
    size = mode_power(modes, trial.after.right, lines).sum(axis=1) + outside_power(trial.after, lines)
    size = size + trial.far_power
    before, after = trial.before.power(lines), trial.after.power(lines)
    own = half_power_lines(complex(modes.poles[-1]), lines)
    best = (0.0, 1.0)
    for number in np.flatnonzero(_within_reach(modes, 4 * lines.spacing)):
        here = half_power_lines(complex(modes.poles[number]), lines)
        if here.any():
            share = float(np.sqrt(before[here].sum() / max(size[here].sum(), 1e-300)))
            best = max(best, (share, float(before[here].sum() / max(after[here].sum(), 1e-300))))
    return *best, _clean(trial, own, after)


def _within_reach(modes: Modes, least: float = 0.0) -> NDArray[np.bool_]:
    """Say which modes stand so near to the last one that their errors touch it; it counts too."""
    width = modes.frequencies * modes.damping_ratios
    distance = np.abs(modes.frequencies - modes.frequencies[-1])
    return np.asarray(distance <= np.maximum(_REACH * (width + width[-1]), least))


def _clean(trial: Trial, own: NDArray[np.bool_], after: Real) -> bool:
    """Whether what the fit with the candidate leaves is noise: of the level expected, or without memory."""
    lines = trial.lines
    where = own if own.any() else np.ones(len(after), dtype=bool)
    if after[where].sum() < CLEAN * lines.noise[where].sum():
        return True
    width = (trial.modes.frequencies * trial.modes.damping_ratios)[_within_reach(trial.modes)]
    if width.min() < _RESOLVED * lines.spacing:
        return False
    middle = float(np.mean(lines.frequencies[where]))
    reach = max(np.ptp(lines.frequencies[where]) / 2, _COLOUR_LINES * lines.spacing)
    return trial.after.colour(lines, np.abs(lines.frequencies - middle) <= reach) < _WHITE


def likeness(modes: Modes, right: NDArray[np.complex128], number: int) -> tuple[float, float]:
    """Largest product of both vectors' modal assurances with a near mode, and that mode's frequency (Hz)."""
    frequency, width = modes.frequencies, modes.frequencies * modes.damping_ratios
    near = np.abs(frequency - frequency[number]) < NEAR * (width + width[number])
    near[number] = False
    if not near.any():
        return 0.0, 0.0
    both = modal_assurance(right[[number]], right)[0] * modal_assurance(modes.left[[number]], modes.left)[0]
    most = int(np.argmax(np.where(near, both, -1.0)))
    return float(both[most]), float(frequency[most])
