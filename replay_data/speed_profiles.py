"""Spindle speed over time: constant, swept, or slowly drifting. The angle is given in closed form."""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from millfrf.core import InputError


class SpeedProfile(Protocol):
    """Interface of a spindle's speed over time."""

    @property
    def slowest(self) -> float:
        """Lowest speed, rad/s, above zero."""
        ...

    @property
    def fastest(self) -> float:
        """Highest speed, rad/s."""
        ...

    def angle(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Angle turned since time 0, rad, at ``time`` (s, zero or more)."""
        ...

    def rehearsed(self, share: float) -> "SpeedProfile":
        """The same course of speed run through in ``share`` of the time."""
        ...

    def description(self) -> dict[str, str | float]:
        """What the recording's set-up says of it."""
        ...


@dataclass(frozen=True)
class ConstantSpeed:
    """``angle = speed t``.

    Parameters
    ----------
    speed
        rad/s, above zero.

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
    def slowest(self) -> float:
        """Lowest speed of the course, rad/s."""
        return self.speed

    @property
    def fastest(self) -> float:
        """Highest speed of the course, rad/s."""
        return self.speed

    def angle(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Angle turned, rad."""
        return np.asarray(self.speed * time)

    def rehearsed(self, share: float) -> "ConstantSpeed":
        """Itself: a constant speed has no course."""
        return self

    def description(self) -> dict[str, str | float]:
        """Kind and speed."""
        return {"speed_profile": "constant", "spindle_speed_rpm": _rpm(self.speed)}


@dataclass(frozen=True)
class LinearSweep:
    """``angle = first t + (last - first) t^2 / (2 duration)``, then on at the last speed.

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
    def slowest(self) -> float:
        """Lowest speed of the course, rad/s."""
        return min(self.first, self.last)

    @property
    def fastest(self) -> float:
        """Highest speed of the course, rad/s."""
        return max(self.first, self.last)

    def angle(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Angle turned, rad."""
        swept = np.minimum(time, self.duration)
        rate = (self.last - self.first) / self.duration
        return np.asarray(self.first * swept + 0.5 * rate * swept**2 + self.last * (time - swept))

    def rehearsed(self, share: float) -> "LinearSweep":
        """The same speeds, swept faster."""
        return LinearSweep(self.first, self.last, self.duration * share)

    def description(self) -> dict[str, str | float]:
        """Kind, both speeds and the duration."""
        return {
            "speed_profile": "linear sweep",
            "first_spindle_speed_rpm": _rpm(self.first),
            "last_spindle_speed_rpm": _rpm(self.last),
            "sweep_duration_s": self.duration,
        }


@dataclass(frozen=True)
class RepeatedSweep:
    """A linear sweep, then the same speeds back, and so on.

    Parameters
    ----------
    first, last : rad/s
        Speed at the beginning and after ``duration``, above zero.
    duration : s
        Duration of one sweep.

    Raises
    ------
    InputError
        A value is not above zero.

    Examples
    --------
    >>> RepeatedSweep(10.0, 20.0, 2.0).angle(np.array([2.0, 4.0, 6.0])).tolist()
    [30.0, 60.0, 90.0]
    """

    first: float
    last: float
    duration: float

    def __post_init__(self) -> None:
        LinearSweep(self.first, self.last, self.duration)  # refuses what is no sweep

    @property
    def slowest(self) -> float:
        """Lowest speed of the course, rad/s."""
        return min(self.first, self.last)

    @property
    def fastest(self) -> float:
        """Highest speed of the course, rad/s."""
        return max(self.first, self.last)

    def angle(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Angle turned, rad."""
        whole = np.floor(time / self.duration)  # sweeps that are over
        rest = time - whole * self.duration
        begin = np.where(whole % 2 == 0, self.first, self.last)
        rate = np.where(whole % 2 == 0, 1.0, -1.0) * (self.last - self.first) / self.duration
        before = 0.5 * (self.first + self.last) * self.duration * whole
        return np.asarray(before + begin * rest + 0.5 * rate * rest**2)

    def rehearsed(self, share: float) -> "RepeatedSweep":
        """The same speeds, swept faster."""
        return RepeatedSweep(self.first, self.last, self.duration * share)

    def description(self) -> dict[str, str | float]:
        """Kind, both speeds and the duration of one sweep."""
        swept = LinearSweep(self.first, self.last, self.duration).description()
        return {**swept, "speed_profile": "linear sweep, back and forth"}


@dataclass(frozen=True)
class DriftingSpeed:
    """A nominally constant speed that wanders: ``mean (1 + share sin(2 pi t / period))``.

    Parameters
    ----------
    mean : rad/s
        Mean speed, above zero.
    share
        Largest departure as a share of the mean, 0 <= share < 1.
    period : s
        Period of the drift.

    Raises
    ------
    InputError
        A value outside these bounds.

    Examples
    --------
    >>> DriftingSpeed(100.0, 0.02, 10.0).angle(np.array([10.0])).round(9).tolist()
    [1000.0]
    """

    mean: float
    share: float
    period: float

    def __post_init__(self) -> None:
        _require_positive("mean spindle speed", self.mean, "rad/s")
        _require_positive("period of the drift", self.period, "s")
        if not 0 <= self.share < 1:
            raise InputError(f"drift of the spindle speed {self.share!r} must lie in 0 <= share < 1")

    @property
    def slowest(self) -> float:
        """Lowest speed of the course, rad/s."""
        return self.mean * (1 - self.share)

    @property
    def fastest(self) -> float:
        """Highest speed of the course, rad/s."""
        return self.mean * (1 + self.share)

    def angle(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Angle turned, rad."""
        rate = 2 * math.pi / self.period
        return np.asarray(self.mean * (time + self.share * (1 - np.cos(rate * time)) / rate))

    def rehearsed(self, share: float) -> "DriftingSpeed":
        """The same wandering, faster."""
        return DriftingSpeed(self.mean, self.share, self.period * share)

    def description(self) -> dict[str, str | float]:
        """Kind, mean, share and period."""
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
