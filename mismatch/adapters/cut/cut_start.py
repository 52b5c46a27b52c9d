"""Where fits of a cut begin: the spindle's angle, and which tooth is which in each recording."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .cut_fit import CutFit, Part, fit_cut
from .cut_setting import Attempt, CutSetting
from .physics import CutPhysics

Real = NDArray[np.float64]

ANGLES = 40
"""Spindle angles tried a pitch."""


def started(setting: CutSetting, acting: Sequence[tuple[CutPhysics, Real]]) -> Attempt:
    """The spindle's angle at which the force, computed as the file says, leaves least of each recording.

    One factor is free: what the coefficients are off does not move the angle.
    """
    teeth = setting.belief.process.teeth
    turns = teeth if setting.belief.process.runout > 0 else 1
    attempt = Attempt(np.zeros(6), tuple(acting), tuple(lines.recording.law for lines in setting.lines))
    laws = []
    for k, law in enumerate(attempt.laws):
        angles = np.arange(ANGLES * turns) * 2 * np.pi / (teeth * ANGLES)
        trials = [_with_law(attempt, k, float(angle)) for angle in angles]
        left = [_left(setting, k, trial) for trial in trials]
        laws.append(replace(law, angle=float(angles[int(np.argmin(left))])))
    return replace(attempt, laws=tuple(laws))


def fit_turned(setting: CutSetting, start: Attempt, freed: Sequence[str], *, part: Part = slice(None)) -> CutFit:
    """:func:`fit_cut`, with the teeth of every further recording numbered as in the first.

    A recording does not say which tooth is tooth 0. Causes that tell teeth apart are fitted to the first recording, the
    others are turned by whole pitches to agree with it, and then all are fitted together.
    """
    teeth = setting.belief.process.teeth
    if teeth == 1 or len(setting.lines) == 1 or not freed:
        return fit_cut(setting, start, freed, part=part)
    alone = fit_cut(setting.only(0), replace(start, laws=start.laws[:1]), freed, part=part)
    attempt = replace(alone.attempt, laws=alone.attempt.laws + start.laws[1:])
    for k in range(1, len(setting.lines)):
        pitch = 2 * np.pi / teeth
        trials = [_with_law(attempt, k, attempt.laws[k].angle + turn * pitch) for turn in range(teeth)]
        left = [float(np.sum(np.abs(setting.residual(k, trial)[part]) ** 2)) for trial in trials]
        attempt = trials[int(np.argmin(left))]
    return fit_cut(setting, attempt, freed, part=part)


def _with_law(attempt: Attempt, number: int, angle: float) -> Attempt:
    laws = list(attempt.laws)
    laws[number] = replace(laws[number], angle=angle)
    return replace(attempt, laws=tuple(laws))


def _left(setting: CutSetting, number: int, attempt: Attempt) -> float:
    shown, measured = setting.shown(number, attempt), setting.lines[number].measured
    power = float(np.sum(np.abs(shown) ** 2))
    gain = max(float(np.real(np.vdot(shown, measured))) / max(power, 1e-300), 0.0)
    return float(np.sum(np.abs(measured - gain * shown) ** 2))
