"""`Behaviour`: change of modes with the level of excitation, and the families of physics that explain it."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import scipy

from millfrf.core import Real

from .level_refit import RefittedModes


@dataclass(frozen=True)
class ModeTrend:
    """One mode at all levels.

    Parameters
    ----------
    mode
        Number of the mode, from 1.
    levels : (n_levels,)
        Root mean square excitation, rising.
    frequencies, frequency_errors : (n_levels,), Hz
        Natural frequency at each level and its standard error.
    damping, damping_errors : (n_levels,)
        Damping ratio and its standard error.
    shift, shift_error
        Relative change of the natural frequency from the lowest to the highest level, and its standard error.
    gain, gain_error
        Relative change of the damping ratio from the lowest to the highest level, and its standard error.
    p_values
        p-values of the shift and of the gain: probability that chance causes changes this large.
    drift_p_value
        p-value of the drift of the frequency within recordings; nan if it cannot be computed.
    drift
        Change of the natural frequency over a recording, as a share, average over the recordings.
    family, sentence
        Family of the behaviour (``FAMILIES``), and a description.
    """

    mode: int
    levels: tuple[float, ...]
    frequencies: tuple[float, ...]
    frequency_errors: tuple[float, ...]
    damping: tuple[float, ...]
    damping_errors: tuple[float, ...]
    shift: float
    shift_error: float
    gain: float
    gain_error: float
    p_values: tuple[float, float]
    drift: float
    drift_p_value: float
    family: str = ""
    sentence: str = ""


def mode_trends(refits: Sequence[RefittedModes], apart: float) -> list[ModeTrend]:
    """Join recordings of nearly equal level, and compare the levels mode by mode.

    The mean over the recordings of a level is weighted by their errors. If the recordings disagree by more than their
    errors, the error of the mean is increased in proportion (Birge, Phys. Rev. 40, 207, 1932).
    """
    groups = _grouped(sorted(refits, key=lambda refit: refit.level), apart)
    means = [_joined(group) for group in groups]
    levels = tuple(float(np.mean([refit.level for refit in group])) for group in groups)
    freedom = tuple(sum(refit.freedom for refit in group) for group in (groups[0], groups[-1]))
    drift, chance = _drift(refits)
    trends = []
    for r in range(refits[0].values.shape[1]):
        logs, errors = np.array([mean[0][:, r] for mean in means]), np.array([mean[1][:, r] for mean in means])
        shift, gain = logs[-1] - logs[0]
        errors_of = np.hypot(errors[-1], errors[0])
        several = len(groups) > 1
        lowest = max(float(logs[0, 1]), 1e-9)
        frequencies = np.exp(logs[:, 0]) / (2 * np.pi)
        trends.append(
            ModeTrend(
                r + 1,
                levels,
                _plain(frequencies),
                _plain(frequencies * errors[:, 0]),
                _plain(logs[:, 1]),
                _plain(errors[:, 1]),
                float(np.expm1(shift)) if several else 0.0,
                float(errors_of[0]),
                float(gain) / lowest if several else 0.0,
                float(errors_of[1]) / lowest,
                _chances(np.array([shift, gain]), errors[[0, -1]], freedom) if several else (1.0, 1.0),
                float(drift[r]),
                float(chance[r]),
            )
        )
    return trends


def _chances(change: Real, errors: Real, freedom: tuple[int, ...]) -> tuple[float, float]:
    """Return the p-values of changes of ln frequency and damping ratio (2,), with the errors of both levels (2, 2)."""
    first, last = (
        _chance(float(change[k] / np.hypot(*errors[:, k])), _welch(errors[:, k], (freedom[0], freedom[1])))
        for k in range(2)
    )
    return first, last


def _plain(values: Real) -> tuple[float, ...]:
    return tuple(float(value) for value in values)


def _grouped(refits: list[RefittedModes], apart: float) -> list[list[RefittedModes]]:
    """Group recordings by level.

    A new level begins at ``apart`` times the excitation of the weakest recording of the level before.
    """
    groups: list[list[RefittedModes]] = []
    for refit in refits:
        if groups and refit.level < apart * groups[-1][0].level:
            groups[-1].append(refit)
        else:
            groups.append([refit])
    return groups


def _joined(group: list[RefittedModes]) -> tuple[Real, Real]:
    """Return the weighted mean of one level and its error, each (2, n_modes)."""
    values, errors = np.array([refit.values for refit in group]), np.array([refit.errors for refit in group])
    weight = 1 / np.maximum(errors, 1e-12) ** 2
    mean = np.sum(weight * values, axis=0) / weight.sum(axis=0)
    error = 1 / np.sqrt(weight.sum(axis=0))
    if len(group) > 1:
        disagreement = np.sum(weight * (values - mean) ** 2, axis=0) / (len(group) - 1)
        error = error * np.sqrt(np.maximum(1.0, disagreement))
    return mean, error


def _drift(refits: Sequence[RefittedModes]) -> tuple[Real, Real]:
    """Return the change of each frequency over a recording, as weighted mean over recordings, and its p-value.

    Each has the shape (n_modes,).
    """
    known = [refit for refit in refits if np.isfinite(refit.drift).all()]
    if not known:
        unknown = np.full(refits[0].values.shape[1], np.nan)
        return unknown, unknown
    values = np.array([state.drift[0] for state in known])
    weight = 1 / np.maximum(np.array([state.drift_errors[0] for state in known]), 1e-12) ** 2
    mean = np.sum(weight * values, axis=0) / weight.sum(axis=0)
    error = 1 / np.sqrt(weight.sum(axis=0))
    if len(known) > 1:
        error = error * np.sqrt(np.maximum(1.0, np.sum(weight * (values - mean) ** 2, axis=0) / (len(known) - 1)))
    freedom = sum(state.freedom - 1 for state in known)
    return np.asarray(mean), np.array([_chance(sigmas, freedom) for sigmas in mean / error])


def _chance(sigmas: float, freedom: float) -> float:
    """Return the two-sided p-value of a deviation by ``sigmas`` estimated standard errors (Student's t)."""
    return float(2 * scipy.special.stdtr(freedom, -abs(sigmas)))


def _welch(errors: Real, freedom: tuple[int, int]) -> float:
    """Return the degrees of freedom of a difference of two means with errors (2,) (Welch, Biometrika 34, 28, 1947)."""
    first, last = np.maximum(errors, 1e-12) ** 2
    return float((first + last) ** 2 / (first**2 / freedom[0] + last**2 / freedom[1]))


# families of behaviour, and their descriptions
FAMILIES: Mapping[str, str] = {
    "none": "no change beyond the errors",
    "hardening": "elastic, hardening: a spring that stiffens, a gap that closes or a stop",
    "softening": "elastic, softening: a spring that weakens, a gap that opens; slip that loses little is not excluded",
    "softening or slip": "slip in a joint (friction, microslip), or a softening spring whose moving frequency smears "
    "the resonance as much",
    "slip": "slip with memory: friction behind a spring, microslip in a bolted joint, or hysteresis",
    "sliding": "friction beyond its limit: it stuck at the low level, and slides at the high one",
    "dry": "dissipative, dry: friction, whose damping falls as motion grows",
    "viscous": "dissipative, faster than velocity: damping of a power above one, as in a fluid",
    "drift": "time-varying: it drifts while the level stays",
    "doubtful": "a change that chance may have made, of all modes that were looked at",
    "uncertain": "a change with the level whose kind depends on the compared band, or on the other modes",
    "cannot tell": "cannot tell",
}

# families that no linear structure shows
FOLLOWS_LEVEL = frozenset(FAMILIES) - {"none", "drift", "doubtful", "cannot tell"}


@dataclass(frozen=True)
class BehaviourSettings:
    """Thresholds of the behaviour by level."""

    # p-value below which a change is reported, for all modes of a diagnosis together; a change that is significant only
    # for its mode alone is doubtful
    chance: float = 0.01
    apart: float = 1.2  # ratio of the excitations from which two recordings have different levels
    # (a, b) of the apparent damping ratio ``d min(a, b d / zeta)`` due to a relative frequency shift d at the damping
    # ratio zeta; only larger changes of the damping count as losses. Under random forces the amplitude fluctuates, and
    # with it the frequency of a nonlinear spring, which widens the resonance by a share of the shift. Both numbers are
    # larger than springs alone can cause
    smeared: tuple[float, float] = (0.5, 0.35)
    # ratio of the change of the damping ratio to the relative shift of the frequency above which only losses are
    # reported, as the pole then moves parallel to the real axis
    dominant: float = 3.0
    # relative standard error of a frequency and of a damping ratio above which nothing can be concluded
    seen: tuple[float, float] = (0.03, 0.5)


def family_of(trend: ModeTrend, tests: int, settings: BehaviourSettings) -> str:
    """Return the family of the behaviour of one mode.

    Stiffness changes the frequency, and losses change the damping. A frequency that changes with the amplitude widens
    the resonance, which imitates damping and is not counted as losses.
    """
    least = settings.chance / tests
    if len(trend.levels) < 2:
        return "drift" if trend.drift_p_value < least else "cannot tell"
    shifts, changes_damping = (p < least for p in trend.p_values)
    if not shifts and trend.drift_p_value < least:
        return "drift"
    if not shifts and not changes_damping:
        if min(trend.p_values) < settings.chance:
            return "doubtful"
        wide = trend.shift_error > settings.seen[0] or trend.gain_error > settings.seen[1]
        return "cannot tell" if wide else "none"
    lost = trend.gain * trend.damping[0]
    if not shifts or (changes_damping and abs(lost) > settings.dominant * abs(trend.shift)):
        return "viscous" if trend.gain > 0 else "dry"
    if trend.shift > 0:
        return "hardening"
    if changes_damping and trend.gain < 0:
        return "sliding"
    if not changes_damping:
        return "softening"
    at_most, slope = settings.smeared
    imitated = abs(trend.shift) * min(at_most, slope * abs(trend.shift) / trend.damping[0]) / trend.damping[0]
    return "slip" if trend.gain - 2 * trend.gain_error > imitated else "softening or slip"


def sentence_of(trend: ModeTrend, family: str, unit: str) -> str:
    """Describe one mode in a sentence; errors are two standard errors."""
    where = f"mode at {trend.frequencies[0]:.4g} Hz"
    if len(trend.levels) < 2:
        description = (
            f"it drifts by {100 * trend.drift:+.2g} % over a recording" if family == "drift" else "one level only"
        )
        return f"{where}: {description}"
    between = f"between {trend.levels[0]:.3g} and {trend.levels[-1]:.3g} {unit}"
    shift, gain = f"{100 * abs(trend.shift):.2g}", f"{100 * abs(trend.gain):.2g}"
    shift_error, gain_error = f"{200 * trend.shift_error:.1g}", f"{200 * trend.gain_error:.2g}"
    if family in ("none", "doubtful", "cannot tell", "drift"):
        numbers = (
            f"frequency {100 * trend.shift:+.2g} ± {shift_error} %, damping {100 * trend.gain:+.2g} ± {gain_error} %"
        )
        ending = {
            "none": "moves no further than its error",
            "doubtful": "seems to move, which chance may have made",
            "cannot tell": "errors are wider than any trend that would tell",
            "drift": f"drifts by {100 * trend.drift:+.2g} % over a recording",
        }[family]
        return f"{where} {ending} ({numbers} {between})"
    verb = "stiffens" if trend.shift > 0 else "softens"
    frequency = f"{verb} by {shift} ± {shift_error} %"
    if family in ("viscous", "dry"):
        frequency = f"all but keeps its frequency ({100 * trend.shift:+.2g} ± {shift_error} %)"
    damping = f"{'gains' if trend.gain > 0 else 'loses'} {gain} ± {gain_error} % of its damping"
    return f"{where} {frequency} and {damping} {between}: {FAMILIES[family]}"


@dataclass(frozen=True)
class Behaviour:
    """Change of modes with the level, determined without any law.

    Parameters
    ----------
    family
        Family of the modes with the clearest change (``FAMILIES``), or ``none``, ``doubtful`` or ``cannot tell`` if
        no change is significant.
    sentence
        Description of the family, with its reason.
    unit
        Unit of the levels.
    modes
        Each mode at all levels.
    distortion
        Sentences on the response at lines that were not excited, at the strongest level; empty if forces do not repeat.
    """

    family: str
    sentence: str
    unit: str
    modes: tuple[ModeTrend, ...]
    distortion: tuple[str, ...] = ()

    @property
    def follows_level(self) -> bool:
        """Whether modes change significantly with the level, unlike the modes of a linear structure."""
        return self.family in FOLLOWS_LEVEL

    def content(self) -> dict[str, Any]:
        """Return numbers and texts for a file."""
        return {
            "family": self.family,
            "sentence": self.sentence,
            "level_unit": self.unit,
            "modes": [asdict(mode) for mode in self.modes],
            "distortion": list(self.distortion),
        }
