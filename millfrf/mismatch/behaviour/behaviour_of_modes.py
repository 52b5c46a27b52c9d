"""`Behaviour`: change of modes with the level of excitation, and the families of physics that explain it."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from estimation import WindowedSpectrum, distortion, steady_periods
from millfrf.core import MillfrfError

from ..models.hypothesis import Hypothesis
from ..physics.library import rig_of
from .level_refit import RefittedModes, refitted_modes
from .mode_trend import ModeTrend, mode_trends

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
    "cannot tell": "cannot tell",
}
"""Families of behaviour, and what each says."""

FOLLOWS_LEVEL = frozenset(FAMILIES) - {"none", "drift", "doubtful", "cannot tell"}
"""Families that no linear structure has, whatever its numbers are."""


@dataclass(frozen=True)
class BehaviourSettings:
    """Thresholds of the behaviour by level.

    Parameters
    ----------
    chance
        Probability below which a change is told, for all modes of a diagnosis together; of one mode alone it is
        doubtful.
    apart
        Ratio of what drives the rig from which two recordings have two levels.
    smeared
        Damping ratio that a frequency which moves with the amplitude imitates: ``d min(a, b d / zeta)`` for a shift by
        the share d at the damping ratio zeta, with (a, b) here. What exceeds it are losses. Within a record of random
        forces the amplitude swells and fades, and the frequency of a spring that stiffens or softens with it: the
        resonance is wider by a share of the shift, less where the shift is small beside its width. Both numbers are
        set above what such springs alone imitate, so that a spring is not taken for losses.
    dominant
        Change of the damping ratio over the share by which the frequency moved, from which losses alone are told: the
        pole then moves along the real axis.
    seen
        Standard error of a frequency, as a share, or of a damping ratio, over itself, above which nothing is seen.
    """

    chance: float = 0.01
    apart: float = 1.2
    smeared: tuple[float, float] = (0.5, 0.35)
    dominant: float = 3.0
    seen: tuple[float, float] = (0.03, 0.5)


def family_of(trend: ModeTrend, tests: int, settings: BehaviourSettings) -> str:
    """The family of one mode's behaviour.

    Stiffness shows in the frequency, losses in the damping. A frequency that moves with the amplitude smears the
    resonance, and seems to add damping: that much is not taken for losses.

    Parameters
    ----------
    trend
        The mode by level.
    tests
        Number of tests that are made together (Bonferroni).
    settings
        Thresholds from which a change is told.
    """
    least = settings.chance / tests
    if len(trend.levels) < 2:
        return "drift" if trend.drift_p_value < least else "cannot tell"
    moves, damps = (p < least for p in trend.p_values)
    if not moves and trend.drift_p_value < least:
        return "drift"
    if not moves and not damps:
        if min(trend.p_values) < settings.chance:
            return "doubtful"
        wide = trend.shift_error > settings.seen[0] or trend.gain_error > settings.seen[1]
        return "cannot tell" if wide else "none"
    lost = trend.gain * trend.damping[0]
    if not moves or (damps and abs(lost) > settings.dominant * abs(trend.shift)):
        return "viscous" if trend.gain > 0 else "dry"
    if trend.shift > 0:
        return "hardening"
    if damps and trend.gain < 0:
        return "sliding"
    if not damps:
        return "softening"
    at_most, slope = settings.smeared
    imitated = abs(trend.shift) * min(at_most, slope * abs(trend.shift) / trend.damping[0]) / trend.damping[0]
    return "slip" if trend.gain - 2 * trend.gain_error > imitated else "softening or slip"


def sentence_of(trend: ModeTrend, family: str, unit: str) -> str:
    """All of one mode in a sentence; errors are two standard errors.

    Parameters
    ----------
    trend
        The mode by level.
    family
        Family of its behaviour, one of :data:`FAMILIES`.
    unit
        Unit of what drives the rig.
    """
    where = f"mode at {trend.frequencies[0]:.4g} Hz"
    if len(trend.levels) < 2:
        told = f"it drifts by {100 * trend.drift:+.2g} % over a recording" if family == "drift" else "one level only"
        return f"{where}: {told}"
    between = f"between {trend.levels[0]:.3g} and {trend.levels[-1]:.3g} {unit}"
    shift, gain = f"{100 * abs(trend.shift):.2g}", f"{100 * abs(trend.gain):.2g}"
    shift_error, gain_error = f"{200 * trend.shift_error:.1g}", f"{200 * trend.gain_error:.2g}"
    if family in ("none", "doubtful", "cannot tell", "drift"):
        held = f"frequency {100 * trend.shift:+.2g} ± {shift_error} %, damping {100 * trend.gain:+.2g} ± {gain_error} %"
        ending = {
            "none": "moves no further than its error",
            "doubtful": "seems to move, which chance may have made",
            "cannot tell": "errors are wider than any trend that would tell",
            "drift": f"drifts by {100 * trend.drift:+.2g} % over a recording",
        }[family]
        return f"{where} {ending} ({held} {between})"
    moved = "stiffens" if trend.shift > 0 else "softens"
    frequency = f"{moved} by {shift} ± {shift_error} %"
    if family in ("viscous", "dry"):
        frequency = f"all but keeps its frequency ({100 * trend.shift:+.2g} ± {shift_error} %)"
    damping = f"{'gains' if trend.gain > 0 else 'loses'} {gain} ± {gain_error} % of its damping"
    return f"{where} {frequency} and {damping} {between}: {FAMILIES[family]}"


@dataclass(frozen=True)
class Behaviour:
    """What the recordings show without any law.

    Parameters
    ----------
    family
        Family of the modes that move most clearly (:data:`FAMILIES`), or ``none``, ``doubtful`` or ``cannot tell``
        where none moves for certain.
    sentence
        The family in words, with its reason.
    unit
        Unit of the levels.
    modes
        Each mode by level.
    distortion
        Sentences on lines that were not excited, strongest level; empty where forces do not repeat.
    """

    family: str
    sentence: str
    unit: str
    modes: tuple[ModeTrend, ...]
    distortion: tuple[str, ...] = ()

    @property
    def follows_level(self) -> bool:
        """Whether modes move with the level for certain, as no linear structure's do."""
        return self.family in FOLLOWS_LEVEL

    def content(self) -> dict[str, Any]:
        """Plain numbers and texts for a file."""
        return {
            "family": self.family,
            "sentence": self.sentence,
            "level_unit": self.unit,
            "modes": [asdict(one) for one in self.modes],
            "distortion": list(self.distortion),
        }


def behaviour_of(
    base: Hypothesis, recordings: Sequence[WindowedSpectrum], settings: BehaviourSettings | None = None
) -> Behaviour:
    """Tell how modes move with the level: each recording is refitted alone, linearly, and levels are compared.

    Nothing is raised: what cannot be computed cannot be told, and the sentence says so.

    Parameters
    ----------
    base
        Modal model fitted to all recordings; linear causes that it holds stay as they are.
    recordings
        Windowed spectra of the recordings.
    settings
        Thresholds; None: the usual ones.
    """
    chosen, unit = settings or BehaviourSettings(), rig_of(base.model).force_unit
    refits = [one for one in (_refitted(base, lines) for lines in recordings) if one is not None]
    if not refits:
        return Behaviour("cannot tell", "Cannot tell: no recording allows a linear refit of its own.", unit, ())
    trends = mode_trends(refits, chosen.apart)
    tests = 3 * len(trends)
    told = []
    for trend in trends:
        family = family_of(trend, tests, chosen)
        told.append(replace(trend, family=family, sentence=sentence_of(trend, family, unit)))
    family = _of_all(told)
    return Behaviour(family, _sentence(family, told), unit, tuple(told), _distortion(recordings))


def _refitted(base: Hypothesis, lines: WindowedSpectrum) -> RefittedModes | None:
    """The refit of one recording; None where it breaks down."""
    try:
        found = refitted_modes(base, lines)
    except (MillfrfError, ValueError, ArithmeticError, np.linalg.LinAlgError):
        return None
    return found if np.isfinite(found.values).all() and np.isfinite(found.errors).all() else None


def _of_all(modes: list[ModeTrend]) -> str:
    """The family that the clearest modes speak for; each mode counts by how clearly it moves."""
    weight: dict[str, float] = defaultdict(float)
    for one in modes:
        if one.family not in ("none", "doubtful", "cannot tell"):
            sigmas = (one.shift / max(one.shift_error, 1e-12), one.gain / max(one.gain_error, 1e-12))
            weight[one.family] += min(max(abs(value) for value in sigmas), 100.0)
    if weight:
        first = max(weight, key=lambda name: weight[name])
        if first == "softening":  # modes whose damping is known say more
            first = next((name for name in ("slip", "softening or slip") if name in weight), first)
        return first
    return next((name for name in ("doubtful", "none") if any(one.family == name for one in modes)), "cannot tell")


def _sentence(family: str, modes: list[ModeTrend]) -> str:
    """The answer in words: the mode that moves most clearly, or why nothing can be told."""
    if family == "none":
        return "No mode moves with the level beyond its error."
    if family == "cannot tell":
        single = len(modes[0].levels) < 2
        reason = "all recordings have one level" if single else "errors are wider than any trend that would tell"
        return f"Cannot tell: {reason}."
    first = max((one for one in modes if one.family == family), key=lambda one: -min(one.p_values))
    ending = f": {FAMILIES[family]}" if len(first.levels) < 2 or family == "drift" else ""
    return f"{first.sentence[:1].upper()}{first.sentence[1:]}{ending}."


def _distortion(recordings: Sequence[WindowedSpectrum]) -> tuple[str, ...]:
    """What the strongest recording shows at lines that were not excited, where its forces repeat."""
    strongest = max(recordings, key=lambda one: one.recording.level).recording
    try:
        return tuple(distortion(steady_periods([strongest])).sentences())
    except (MillfrfError, ValueError, ArithmeticError, np.linalg.LinAlgError):
        return ()
