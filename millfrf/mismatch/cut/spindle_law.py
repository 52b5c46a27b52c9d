"""`SpindleLaw`: the spindle's angle over a recording, stated roughly and found exactly from the forces."""

import os
import tomllib
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquisition import opened
from millfrf.core import InputError, Real

from ..location.maps import SPEED, spindle_speed

WITHIN = 0.02
"""Share by which the stated speed may be off."""

HARMONICS = 3
"""Number of harmonics of the tooth passing by which the speed is found."""

LEAST_CONTRAST = 5.0
"""Power of the comb at the found speed over its median at other speeds."""

LEAST_SHARE = 0.1
"""Share of the forces' power that the comb must hold: the skirt of another line holds less."""


@dataclass(frozen=True)
class SpindleLaw:
    """``angle(t) = angle + speed (t - middle) + change (t - middle)^2 / 2``.

    Parameters
    ----------
    middle
        Instant from which the law is counted, s after the first sample.
    angle
        Angle of tooth 0 at this instant, rad.
    speed
        Speed at this instant, rad/s.
    change
        Change of the speed, rad/s^2.

    Examples
    --------
    >>> law = SpindleLaw(1.0, 0.0, 10.0, 2.0)
    >>> float(law.angles(np.array([2.0]))[0])
    11.0
    """

    middle: float
    angle: float
    speed: float
    change: float = 0.0

    def angles(self, times: Real) -> Real:
        """Angle of tooth 0, (n,), rad.

        Parameters
        ----------
        times : (n,)
            Instants since the first sample, s.
        """
        t = times - self.middle
        return np.asarray(self.angle + self.speed * t + 0.5 * self.change * t**2)

    def speeds(self, times: Real) -> Real:
        """Speed of the spindle, (n,), rad/s.

        Parameters
        ----------
        times : (n,)
            Instants since the first sample, s.
        """
        return np.asarray(self.speed + self.change * (times - self.middle))

    def lag(self, times: Real, turned: float) -> Real:
        """Time s, (n,), s, in which the spindle has turned by an angle: ``turned = speed s - change s^2 / 2``.

        Parameters
        ----------
        times : (n,)
            Instants since the first sample, s.
        turned
            Angle by which the spindle has turned, rad.
        """
        speed = self.speeds(times)
        return np.asarray(2 * turned / (speed + np.sqrt(np.maximum(speed**2 - 2 * self.change * turned, 0.0))))

    def about(self, middle: float) -> "SpindleLaw":
        """The same law, counted from another instant.

        Parameters
        ----------
        middle
            The other instant, s.
        """
        at = np.array([middle])
        return SpindleLaw(middle, float(self.angles(at)[0]), float(self.speeds(at)[0]), self.change)


def stated_law(path: str | os.PathLike[str], speed: float | None = None) -> SpindleLaw:
    """The law that the user, the recording's events or its set-up state, the angle unknown (0).

    Parameters
    ----------
    path
        File of the recording.
    speed
        Spindle speed, rad/s; None: the one that the recording states.

    Raises
    ------
    InputError
        No speed stated, or one that is neither constant nor swept linearly.
    """
    if speed is not None:
        if not (np.isfinite(speed) and speed > 0):
            raise InputError(
                f"spindle speed {speed * 30 / np.pi:g} rpm must be positive; "
                "correct the speed (speed in rad/s, --speed in rpm)"
            )
        return SpindleLaw(0.0, 0.0, float(speed))
    name = Path(path).name
    swept = _stated_sweep(path)
    if swept is not None:
        return swept
    known = spindle_speed(path)
    if known is None:
        raise InputError(
            f"{name} states no spindle speed that is constant or swept linearly; "
            "give a constant speed (speed in rad/s, --speed in rpm)"
        )
    rates = known.rpm * np.pi / 30
    if len(rates) < 3:
        return SpindleLaw(0.0, 0.0, float(rates.mean()))
    slope, start = np.polyfit(known.time, rates, 1)
    off = float(np.std(rates - start - slope * known.time) / rates.mean())
    if off > WITHIN / 4:
        raise InputError(f"{name}: the spindle speed departs by {100 * off:.2g} % from a line; cut out a steady part")
    return SpindleLaw(0.0, 0.0, float(start), float(slope))


def _stated_sweep(path: str | os.PathLike[str]) -> SpindleLaw | None:
    with opened(path) as recording:
        setup = recording.setup
    try:
        tables = [table for table in tomllib.loads(setup).values() if isinstance(table, dict)]
    except tomllib.TOMLDecodeError:
        return None
    for table in tables:
        if table.get("speed_profile") == "linear sweep":
            first, last = (float(table[f"{which}_{SPEED}"]) * np.pi / 30 for which in ("first", "last"))
            return SpindleLaw(0.0, 0.0, first, (last - first) / float(table["sweep_duration_s"]))
    return None


def found_law(force: Real, rate: float, stated: SpindleLaw, teeth: int) -> SpindleLaw:
    """Speed and its change at which most power lies on the tooth passing's harmonics; the angle stays unknown (0).

    ``max sum_m |sum_t F(t) exp(-i m N angle(t))|^2``, m = 1 ... 3, the likelihood of a comb in white noise.

    Parameters
    ----------
    force : (n, n_channels)
        Measured forces, N.
    rate
        Sampling rate, Hz.
    stated
        Law around which the speed is sought, within two per cent.
    teeth
        Number of teeth N.

    Raises
    ------
    InputError
        No speed stands out.
    """
    time = np.arange(len(force)) / rate
    law = stated.about(float(time[-1]) / 2)
    if not law.speeds(time).min() > 0:
        raise InputError("the stated sweep of the spindle stops within the recording; cut out the part that mills")
    slow, centre = _phasors(force - force.mean(axis=0), time, law, teeth)
    step = 0.5 * np.pi / (HARMONICS * teeth * time[-1])
    speeds = np.arange(-WITHIN * law.speed, WITHIN * law.speed + step, step)
    bend = 6.0 / (HARMONICS * teeth * (time[-1] / 2) ** 2) / 4
    wide = max(3.0, 0.01 * abs(law.change) / bend)
    changes = bend * np.arange(-np.ceil(wide), np.ceil(wide) + 1)
    powers = np.array([[_power(slow, centre, teeth, dw, da) for dw in speeds] for da in changes])
    row, column = np.unravel_index(int(np.argmax(powers)), powers.shape)
    share = 2 * powers.max() / slow.shape[1] ** 2 / float(np.sum(np.var(force, axis=0)))
    if powers.max() < LEAST_CONTRAST * np.median(powers[row]) or share < LEAST_SHARE:
        raise InputError(
            f"no tooth passing within {100 * WITHIN:g} % of {law.speed * 30 / np.pi:.4g} rpm stands out of the forces; "
            "give the right speed (speed in rad/s, --speed in rpm), and a cut of constant engagement"
        )
    return replace(law, speed=law.speed + float(speeds[column]), change=law.change + float(changes[row]))


def _phasors(force: Real, time: Real, law: SpindleLaw, teeth: int) -> tuple[NDArray[np.complex128], Real]:
    """Demodulated forces, averaged over half revolutions, (HARMONICS, n_parts, n_channels), and their times."""
    size = max(1, int(np.pi / law.speed / (time[1] - time[0])))
    kept = len(time) // size * size
    angles = law.angles(time[:kept])
    parts = [
        (force[:kept] * np.exp(-1j * m * teeth * angles)[:, None]).reshape(-1, size, force.shape[1]).mean(axis=1)
        for m in range(1, HARMONICS + 1)
    ]
    return np.array(parts), time[:kept].reshape(-1, size).mean(axis=1) - law.middle


def _power(slow: NDArray[np.complex128], centre: Real, teeth: int, speed: float, change: float) -> float:
    turned = teeth * (speed * centre + 0.5 * change * centre**2)
    waves = np.exp(-1j * np.arange(1, HARMONICS + 1)[:, None] * turned)
    return float(np.sum(np.abs(np.einsum("mt,mtc->mc", waves, slow)) ** 2))
