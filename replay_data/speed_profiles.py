"""Spindle speed over time: constant, swept, or slowly drifting. The angle is given in closed form."""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from millfrf.core import InputError, Real


class SpeedProfile(ABC):
    """Base class of spindle speeds over time."""

    @property
    @abstractmethod
    def limits(self) -> tuple[float, float]:
        """Return lowest and highest speed in any order, rad/s, above zero."""

    @property
    def slowest(self) -> float:
        """Return the lowest speed, rad/s."""
        return min(self.limits)

    @property
    def fastest(self) -> float:
        """Return the highest speed, rad/s."""
        return max(self.limits)

    @abstractmethod
    def angle(self, time: Real) -> Real:
        """Return the angle turned since time 0, rad, at ``time`` (s, zero or more)."""

    @abstractmethod
    def rehearsed(self, share: float) -> Self:
        """Return the profile that runs through the same speeds in ``share`` of the time."""

    @abstractmethod
    def description(self) -> dict[str, str | float]:
        """Return the entries of the profile for the set-up of a recording."""


@dataclass(frozen=True)
class ConstantSpeed(SpeedProfile):
    """A constant spindle speed: ``angle = speed t``.

    Parameters
    ----------
    speed
        Spindle speed, rad/s, above zero.

    Raises
    ------
    InputError
        The speed is not above zero.

    Examples
    --------
    >>> ConstantSpeed(100.0).angle(np.array([0.0, 0.5])).tolist()
    [0.0, 50.0]
    """

    speed: float

    def __post_init__(self) -> None:
        _require_positive("spindle speed", self.speed, "rad/s")

    @property
    def limits(self) -> tuple[float, float]:
        """Return lowest and highest speed in any order, rad/s."""
        return self.speed, self.speed

    def angle(self, time: Real) -> Real:
        """Return the angle turned since time 0, rad, at ``time`` (s)."""
        return np.asarray(self.speed * time)

    def rehearsed(self, share: float) -> Self:
        """Return the profile itself, because it has one speed only."""
        return self

    def description(self) -> dict[str, str | float]:
        """Return the entries of the profile for the set-up of a recording."""
        return {"speed_profile": "constant", "spindle_speed_rpm": _rpm(self.speed)}


@dataclass(frozen=True)
class LinearSweep(SpeedProfile):
    """A linear sweep, then constant: ``angle = first t + (last - first) t^2 / (2 duration)`` during the sweep.

    Parameters
    ----------
    first, last : rad/s
        First and last speed of the sweep, above zero; up or down.
    duration : s
        Duration of the sweep.

    Raises
    ------
    InputError
        A value is not above zero.

    Examples
    --------
    >>> LinearSweep(10.0, 20.0, 2.0).angle(np.array([2.0, 3.0])).tolist()
    [30.0, 50.0]
    """

    first: float
    last: float
    duration: float

    def __post_init__(self) -> None:
        _require_positive("first spindle speed", self.first, "rad/s")
        _require_positive("last spindle speed", self.last, "rad/s")
        _require_positive("duration of the sweep", self.duration, "s")

    @property
    def limits(self) -> tuple[float, float]:
        """Return first and last speed, rad/s."""
        return self.first, self.last

    def angle(self, time: Real) -> Real:
        """Return the angle turned since time 0, rad, at ``time`` (s)."""
        swept = np.minimum(time, self.duration)
        rate = (self.last - self.first) / self.duration
        return np.asarray(self.first * swept + 0.5 * rate * swept**2 + self.last * (time - swept))

    def rehearsed(self, share: float) -> Self:
        """Return the profile that runs through the same speeds in ``share`` of the time."""
        return replace(self, duration=self.duration * share)

    def description(self) -> dict[str, str | float]:
        """Return the entries of the profile for the set-up of a recording."""
        return {
            "speed_profile": "linear sweep",
            "first_spindle_speed_rpm": _rpm(self.first),
            "last_spindle_speed_rpm": _rpm(self.last),
            "sweep_duration_s": self.duration,
        }


@dataclass(frozen=True)
class RepeatedSweep(LinearSweep):
    """A linear sweep from ``first`` to ``last``, then back to ``first``, and so on.

    Examples
    --------
    >>> RepeatedSweep(10.0, 20.0, 2.0).angle(np.array([2.0, 4.0, 6.0])).tolist()
    [30.0, 60.0, 90.0]
    """

    def angle(self, time: Real) -> Real:
        """Return the angle turned since time 0, rad, at ``time`` (s)."""
        finished = np.floor(time / self.duration)  # complete sweeps
        since = time - finished * self.duration
        begin = np.where(finished % 2 == 0, self.first, self.last)
        rate = np.where(finished % 2 == 0, 1.0, -1.0) * (self.last - self.first) / self.duration
        before = 0.5 * (self.first + self.last) * self.duration * finished
        return np.asarray(before + begin * since + 0.5 * rate * since**2)

    def description(self) -> dict[str, str | float]:
        """Return the entries of the profile for the set-up of a recording."""
        return {**super().description(), "speed_profile": "linear sweep, back and forth"}


@dataclass(frozen=True)
class DriftingSpeed(SpeedProfile):
    """A nominally constant speed with a slow drift: ``mean (1 + share sin(2 pi t / period))``.

    Examples
    --------
    >>> DriftingSpeed(100.0, 0.02, 10.0).angle(np.array([10.0])).round(9).tolist()
    [1000.0]
    """

    mean: float  # rad/s, above zero
    share: float  # largest deviation over the mean, 0 <= share < 1
    period: float  # s

    def __post_init__(self) -> None:
        _require_positive("mean spindle speed", self.mean, "rad/s")
        _require_positive("period of the drift", self.period, "s")
        if not 0 <= self.share < 1:
            raise InputError(f"drift of the spindle speed {self.share!r} must lie in 0 <= share < 1")

    @property
    def limits(self) -> tuple[float, float]:
        """Return lowest and highest speed, rad/s."""
        return self.mean * (1 - self.share), self.mean * (1 + self.share)

    def angle(self, time: Real) -> Real:
        """Return the angle turned since time 0, rad, at ``time`` (s)."""
        rate = 2 * math.pi / self.period
        return np.asarray(self.mean * (time + self.share * (1 - np.cos(rate * time)) / rate))

    def rehearsed(self, share: float) -> Self:
        """Return the profile that runs through the same speeds in ``share`` of the time."""
        return replace(self, period=self.period * share)

    def description(self) -> dict[str, str | float]:
        """Return the entries of the profile for the set-up of a recording."""
        return {
            "speed_profile": "drifting",
            "spindle_speed_rpm": _rpm(self.mean),
            "drift_share": self.share,
            "drift_period_s": self.period,
        }


def _rpm(speed: float) -> float:
    return round(speed * 30 / math.pi, 9)


def _require_positive(name: str, value: float, unit: str) -> None:
    if not (math.isfinite(value) and value > 0):
        raise InputError(f"{name} = {value!r} {unit} must be positive and finite")
