"""Recordings predicted by a robot that was fitted to the others, and whether that is better than chance."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, rfft
from scipy.stats import wilcoxon

from estimation import WindowedSpectrum

from .posed_recording import halves
from .robot_receptance import RobotModes, predicted_lines
from .robot_search import FreeFit, fit_from, free_fit
from .robot_setting import Changes, Setting

Real = NDArray[np.float64]

BLOCK = 1.0
"""Length of a block of time for the test of significance, s: several time constants of a robot's modes."""

SIGNIFICANT = 0.01
"""Chance below which errors of blocks held out are taken to have changed."""

LEAST_BLOCKS = 7
"""Blocks without which no signed rank reaches ``SIGNIFICANT``."""


@dataclass(frozen=True)
class Fold:
    """One recording left out.

    Parameters
    ----------
    name
        Of the recording left out.
    others, alone
        The setting with the others, and with it alone.
    seen
        Free fit of the others.
    floor
        Error that modes fitted freely to the recording left out leave of it.
    """

    name: str
    others: Setting
    alone: Setting
    seen: FreeFit
    floor: float


@dataclass(frozen=True)
class Tested:
    """What changes are worth where they were not fitted.

    Parameters
    ----------
    numbers : (n_folds, n_changes)
        Fitted without the recording left out.
    errors, floors : (n_folds,)
        Relative to the root mean square response: by the robot without deviations, and by modes fitted freely.
    blocks
        Squared error of each block of time over the recording's mean square response, one array a fold.
    """

    numbers: Real
    errors: Real
    floors: Real
    blocks: tuple[Real, ...]

    @property
    def beyond(self) -> float:
        """Squared error beyond that of freely fitted modes, mean over the recordings left out."""
        return float(np.mean(np.maximum(self.errors**2 - self.floors**2, 0.0)))


def folds_of(setting: Setting, free: FreeFit, start: Changes) -> tuple[Fold, ...]:
    """One recording after the other left out; a single one is cut in two."""
    if len(setting.recordings) == 1:
        setting = replace(setting, recordings=halves(setting.recordings[0]), counts=setting.counts * 2)
        free = free_fit(setting, start)
    folds = []
    for out, recording in enumerate(setting.recordings):
        kept = [i for i in range(len(setting.recordings)) if i != out]
        measured = recording.lines.measured
        floor = np.linalg.norm(measured - predicted_lines(free.fitted.modes[out], recording.lines))
        share = float(floor / np.linalg.norm(measured))
        folds.append(Fold(recording.name, setting.only(kept), setting.only([out]), free.only(kept), share))
    return tuple(folds)


def tested(folds: Sequence[Fold], changes: Changes) -> Tested:
    """Fit the changes' numbers to the others of each fold, from ``changes``, and predict what was left out."""
    numbers, errors, blocks = [], [], []
    for fold in folds:
        fitted = fit_from(fold.others, changes, fold.seen).changes if changes else ()
        modes, lines = fold.alone.modes(fitted)[0], fold.alone.recordings[0].lines
        rest = np.linalg.norm(lines.measured - predicted_lines(modes, lines))
        errors.append(float(rest / np.linalg.norm(lines.measured)))
        numbers.append([number for _, number in fitted])
        blocks.append(block_errors(modes, lines))
    return Tested(np.array(numbers), np.array(errors), np.array([fold.floor for fold in folds]), tuple(blocks))


def block_errors(modes: RobotModes, lines: WindowedSpectrum) -> Real:
    """Squared error of a prediction in blocks of time, over the mean square response, (n_blocks,)."""
    frequencies = lines.padded_frequencies
    inside = (frequencies >= lines.frequencies[0]) & (frequencies <= lines.frequencies[-1])
    rest = rfft(lines.recording.response, n=lines.padded, axis=0) * inside[:, None]
    size = irfft(rest, n=lines.padded, axis=0)
    moved = np.einsum("kpq,kq->kp", modes.receptance(frequencies[inside]), lines.force_lines[inside])
    rest[inside] -= moved * lines.padded_kinematic[inside]
    left = irfft(rest, n=lines.padded, axis=0)
    kept, length = slice(lines.start, lines.start + len(lines.window)), int(BLOCK * lines.recording.rate)
    count = len(lines.window) // length
    power = np.sum(left[kept][: count * length] ** 2, axis=1).reshape(count, length).mean(axis=1)
    return np.asarray(power / np.mean(np.sum(size[kept] ** 2, axis=1)))


def chance(before: Sequence[Real], after: Sequence[Real]) -> float:
    """p-value that ``after`` is not below ``before``: signed ranks of paired blocks (Wilcoxon 1945)."""
    fall = np.concatenate(list(before)) - np.concatenate(list(after))
    if len(fall) < LEAST_BLOCKS or not fall.any():
        return 1.0
    return float(wilcoxon(fall, alternative="greater").pvalue)


def lowers(before: Tested, after: Tested) -> bool:
    """Whether the error on recordings held out falls, and by more than chance."""
    falls = float(np.mean(after.errors**2)) < float(np.mean(before.errors**2))
    return falls and chance(before.blocks, after.blocks) < SIGNIFICANT


def raised(before: Tested, after: Tested) -> tuple[int, ...]:
    """Folds on which the error grows by more than chance."""
    return tuple(
        k
        for k, (one, other) in enumerate(zip(before.blocks, after.blocks, strict=True))
        if after.errors[k] > before.errors[k] and chance([other], [one]) < SIGNIFICANT
    )
