"""Coefficients, causes and the spindle's angle fitted to recordings of a cut: `fit_cut`."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...inference.bounded_steps import least_squares_within
from .cut_setting import Attempt, CutSetting
from .recordings.spindle_law import SpindleLaw

Real = NDArray[np.float64]

TURN = 0.01
"""Unit of the spindle's angle in a fit, rad, at the middle or at the ends of the recording."""

DIFFERENCE = 0.05
"""Step of the finite differences, in units of the fit."""

Part = slice


@dataclass(frozen=True)
class CutFit:
    """A fitted set of numbers.

    Parameters
    ----------
    attempt
        The numbers.
    freed
        Names of the causes that were fitted.
    misfit
        ``2 sum |W r|^2`` over the blocks that were fitted.
    deviation
        ``|u|^2`` of the coefficients.
    price
        ``n ln N`` of the causes' numbers.
    covariance
        Of deviations, then of the freed causes' numbers in fit units, the spindle's angle taken into account.
    block_misfits
        One array a recording, (n_blocks,), of all blocks.
    """

    attempt: Attempt
    freed: tuple[str, ...]
    misfit: float
    deviation: float
    price: float
    covariance: Real
    block_misfits: tuple[Real, ...]

    @property
    def score(self) -> float:
        """Misfit, deviation and price together: the smaller, the better."""
        return self.misfit + self.deviation + self.price


def fit_cut(
    setting: CutSetting,
    start: Attempt,
    freed: Sequence[str] = (),
    *,
    part: Part = slice(None),
    refit: bool = True,
    most: int = 15,
) -> CutFit:
    """Minimise ``2 sum |W r|^2 + |u|^2`` over the coefficients, the freed causes' numbers and the spindle's angle.

    Parameters
    ----------
    setting
        Recordings with their noise.
    start
        Where to begin.
    freed
        Causes whose numbers are fitted.
    part
        Blocks that are fitted.
    refit
        Whether the coefficients may move.
    most
        Steps at most.
    """
    unknowns = _Unknowns(setting, start, tuple(freed), refit)

    def residual(x: Real) -> Real:
        return _stacked(setting, unknowns.attempt(x), part, unknowns)

    def slopes(x: Real, middle: Real) -> Real:
        steps = np.where(x + DIFFERENCE > unknowns.high, -DIFFERENCE, DIFFERENCE)
        moved = zip(steps, unknowns.axes, strict=True)
        return np.stack([(residual(x + step * axis) - middle) / step for step, axis in moved]).T

    begin = np.clip(unknowns.start(), unknowns.low, unknowns.high)
    found = least_squares_within(residual, slopes, begin, (unknowns.low, unknowns.high), most=most)
    attempt = unknowns.attempt(found.x)
    spread = np.linalg.pinv(found.information, hermitian=True)[: unknowns.physical, : unknowns.physical]
    covariance = np.asarray(spread, dtype=np.float64)
    blocks = tuple(block_misfits(setting, attempt))
    misfit = float(sum(one[part].sum() for one in blocks))
    count = sum(2 * lines.measured[part].size for lines in setting.lines)
    price = unknowns.numbers * float(np.log(count))
    return CutFit(attempt, tuple(freed), misfit, float(np.sum(attempt.deviations**2)), price, covariance, blocks)


def block_misfits(setting: CutSetting, attempt: Attempt) -> list[Real]:
    """``2 sum |W r|^2`` of every block, one array a recording."""
    return [
        np.asarray(2 * np.sum(np.abs(setting.residual(k, attempt)) ** 2, axis=(1, 2)))
        for k in range(len(setting.lines))
    ]


def _stacked(setting: CutSetting, attempt: Attempt, part: Part, unknowns: "_Unknowns") -> Real:
    rows = []
    for k in range(len(setting.lines)):
        rest = np.sqrt(2) * setting.residual(k, attempt)[part].ravel()
        rows += [rest.real, rest.imag]
    if unknowns.refit:
        rows.append(attempt.deviations)
    return np.concatenate(rows)


class _Unknowns:
    """Order and units of the fitted numbers: deviations, causes' numbers, three of the spindle a recording."""

    def __init__(self, setting: CutSetting, start: Attempt, freed: tuple[str, ...], refit: bool) -> None:
        self._start, self._freed, self.refit = start, freed, refit
        self._coefficients = 6 if refit else 0
        process = setting.belief.process
        self._parameters = [
            (name, cause.parameters(process)) for name in freed for cause, _ in start.acting if cause.name == name
        ]
        self.numbers = sum(len(parameters) for _, parameters in self._parameters)
        self.physical = self._coefficients + self.numbers
        spans = [len(lines.recording.force) / lines.recording.rate / 2 for lines in setting.lines]
        self._units = [TURN * np.array([1.0, 1 / span, 2 / span**2]) for span in spans]
        flat = [parameter for _, parameters in self._parameters for parameter in parameters]
        spindle = np.full(3 * len(spans), np.inf)
        lowest = setting.belief.lowest if refit else np.zeros(0)
        self.low = np.concatenate([lowest, [p.low / p.unit_step for p in flat], -spindle])
        self.high = np.concatenate([np.full(self._coefficients, 40.0), [p.high / p.unit_step for p in flat], spindle])
        self.axes = np.eye(len(self.low))

    def start(self) -> Real:
        """The numbers to begin with."""
        parts = [self._start.deviations] if self.refit else []
        for name, parameters in self._parameters:
            values = self._start.values(name)
            parts.append(np.array([p.to_fit(float(v)) for p, v in zip(parameters, values, strict=True)]))
        return np.concatenate([*parts, np.zeros(3 * len(self._units))])

    def attempt(self, x: Real) -> Attempt:
        """The same as an attempt."""
        attempt = self._start
        if self.refit:
            attempt = replace(attempt, deviations=x[:6])
        at = self._coefficients
        for name, parameters in self._parameters:
            values = np.array([p.from_fit(float(x[at + i])) for i, p in enumerate(parameters)])
            attempt = attempt.with_values(name, values)
            at += len(parameters)
        laws = tuple(
            _moved(law, unit * x[at + 3 * k : at + 3 * k + 3])
            for k, (law, unit) in enumerate(zip(self._start.laws, self._units, strict=True))
        )
        return replace(attempt, laws=laws)


def _moved(law: SpindleLaw, by: Real) -> SpindleLaw:
    return SpindleLaw(law.middle, law.angle + float(by[0]), law.speed + float(by[1]), law.change + float(by[2]))
