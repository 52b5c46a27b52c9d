"""`Behaviour`: what modes do with the level, whatever law stands behind it."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from estimation import WindowedSpectrum, distortion, steady_periods
from foundation import MillfrfError

from ..models import Hypothesis
from ..physics import rig_of
from .families import FAMILIES, FOLLOWS_LEVEL, BehaviourSettings, family_of, sentence_of
from .level_refit import RefittedModes, refitted_modes
from .mode_trend import ModeTrend, mode_trends


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
