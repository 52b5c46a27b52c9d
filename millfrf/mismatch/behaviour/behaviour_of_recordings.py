"""Change of modes with the level from linear refits, stated only if it does not depend on band and other modes."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from estimation import WindowedSpectrum, distortion, steady_periods
from millfrf.core import MillfrfError

from ..models.hypothesis import Hypothesis
from ..physics.library import rig_of
from .behaviour_of_modes import (
    FAMILIES,
    FOLLOWS_LEVEL,
    Behaviour,
    BehaviourSettings,
    ModeTrend,
    family_of,
    mode_trends,
    sentence_of,
)
from .level_refit import RefittedModes, half_around, refitted_modes

STATED_ERRORS = 2.0  # standard errors by which a change must differ from zero in every refit, as sentences state them


def behaviour_of(base: Hypothesis, recordings: Sequence[WindowedSpectrum]) -> Behaviour:
    """Determine how modes change with the level, from linear refits of the single recordings.

    No exception is raised: if a refit fails, the sentence of the result states that nothing can be concluded.

    Parameters
    ----------
    base
        Modal model fitted to all recordings; its linear causes are not refitted.
    recordings
        Windowed spectra of the recordings.
    """
    chosen, unit = BehaviourSettings(), rig_of(base.model).force_unit
    refits = _refits(base, recordings)
    if not refits:
        return Behaviour("cannot tell", "Cannot tell: no recording allows a linear refit of its own.", unit, ())
    trends = mode_trends(refits, chosen.apart)
    tests = 3 * len(trends)
    described = []
    for trend in trends:
        family = family_of(trend, tests, chosen)
        described.append(replace(trend, family=family, sentence=sentence_of(trend, family, unit)))
    while (clearest := _clearest(_of_all(described), described)) is not None:
        checked = _if_it_survives(clearest, base, recordings, chosen)
        described[clearest.mode - 1] = checked
        if checked is clearest:
            break
    family = _of_all(described)
    return Behaviour(family, _sentence(family, described), unit, tuple(described), _distortion(recordings))


def _refits(base: Hypothesis, recordings: Sequence[WindowedSpectrum], alone: int | None = None) -> list[RefittedModes]:
    """Return the refits of the recordings that succeed; ``alone``: index of the only mode that is refitted."""
    refits = []
    for lines in recordings:
        try:
            refit = refitted_modes(base, lines, alone)
        except (MillfrfError, ValueError, ArithmeticError, np.linalg.LinAlgError):
            continue
        if np.isfinite(refit.values).all() and np.isfinite(refit.errors).all():
            refits.append(refit)
    return refits


def _clearest(family: str, modes: Sequence[ModeTrend]) -> ModeTrend | None:
    """Return the mode whose change with the level is stated; None if no mode changes with the level."""
    if family not in FOLLOWS_LEVEL or family == "uncertain":
        return None
    return min((mode for mode in modes if mode.family == family), key=lambda mode: min(mode.p_values))


def _if_it_survives(
    trend: ModeTrend, base: Hypothesis, recordings: Sequence[WindowedSpectrum], settings: BehaviourSettings
) -> ModeTrend:
    """Return the trend of a mode, or an uncertain one if another refit does not show the same change.

    The mode is refitted in half of the compared band around it, and with all other modes fixed. A nonlinear structure
    has no modes: which pole a linear refit finds may depend on the lines and on the other modes that describe them.
    """
    place, frequency = trend.mode - 1, trend.frequencies[0]
    halves = [half_around(lines, frequency) for lines in recordings]
    low, high = halves[0].frequencies[0], halves[0].frequencies[-1]
    variants = (
        (f"from {low:.3g} to {high:.3g} Hz", _refits(base, halves)),
        ("with the other modes fixed", _refits(base, recordings, place)),
    )
    contradictions = []
    for where, refits in variants:
        again = mode_trends(refits, settings.apart)[place] if len(refits) > 1 else None
        if again is None or not _same_change(trend, again):
            contradictions.append(f"{where} {'no refit succeeds' if again is None else _change(trend, again)}")
    if not contradictions:
        return trend
    sentence = (
        f"mode at {frequency:.4g} Hz changes with the level, but how is uncertain: over the whole band "
        f"{_change(trend, trend)}, {' and '.join(contradictions)}"
    )
    return replace(trend, family="uncertain", sentence=sentence)


def _same_change(trend: ModeTrend, again: ModeTrend) -> bool:
    """Return whether the change that names the family has the same sign and exceeds its error in another refit."""
    (before, _), (after, error) = _quantity(trend, trend), _quantity(trend, again)
    return bool(before * after > 0 and abs(after) > STATED_ERRORS * error)


def _quantity(trend: ModeTrend, of: ModeTrend) -> tuple[float, float]:
    """Return the change, and its standard error, that names the family of ``trend``: of damping or of frequency."""
    if trend.family in ("viscous", "dry"):
        return of.gain, of.gain_error
    return of.shift, of.shift_error


def _change(trend: ModeTrend, of: ModeTrend) -> str:
    """Return the change that names the family of ``trend`` in words, with two standard errors."""
    value, error = (100 * number for number in _quantity(trend, of))
    name = "damping" if trend.family in ("viscous", "dry") else "frequency"
    return f"its {name} changes by {value:+.2g} ± {STATED_ERRORS * error:.1g} %"


def _of_all(modes: list[ModeTrend]) -> str:
    """Return the family of the clearest modes; each mode is weighted by the significance of its change."""
    weight: dict[str, float] = defaultdict(float)
    for mode in modes:
        if mode.family not in ("none", "doubtful", "cannot tell"):
            sigmas = (mode.shift / max(mode.shift_error, 1e-12), mode.gain / max(mode.gain_error, 1e-12))
            weight[mode.family] += min(max(abs(value) for value in sigmas), 100.0)
    if weight:
        first = max(weight, key=lambda name: weight[name])
        if first == "softening":  # a family that also describes the damping is more specific
            first = next((name for name in ("slip", "softening or slip") if name in weight), first)
        return first
    return next((name for name in ("doubtful", "none") if any(mode.family == name for mode in modes)), "cannot tell")


def _sentence(family: str, modes: list[ModeTrend]) -> str:
    """Describe the mode with the clearest change, or why nothing can be concluded."""
    if family == "none":
        return "No mode moves with the level beyond its error."
    if family == "cannot tell":
        single = len(modes[0].levels) < 2
        reason = "all recordings have one level" if single else "errors are wider than any trend that would tell"
        return f"Cannot tell: {reason}."
    first = max((mode for mode in modes if mode.family == family), key=lambda mode: -min(mode.p_values))
    ending = f": {FAMILIES[family]}" if len(first.levels) < 2 or family == "drift" else ""
    return f"{first.sentence[:1].upper()}{first.sentence[1:]}{ending}."


def _distortion(recordings: Sequence[WindowedSpectrum]) -> tuple[str, ...]:
    """Return sentences on lines of the strongest recording that were not excited, if its forces repeat."""
    strongest = max(recordings, key=lambda recording: recording.recording.level).recording
    try:
        return tuple(distortion(steady_periods([strongest])).sentences())
    except (MillfrfError, ValueError, ArithmeticError, np.linalg.LinAlgError):
        return ()
