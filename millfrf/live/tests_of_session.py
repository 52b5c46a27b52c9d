"""Tests of a session: recorded before, running, and planned."""

import math
import time
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition import Recording, StreamDescription
from estimation import CrossSpectra, SweepPlan
from millfrf.core import InputError, MillfrfError
from millfrf.cutting import immersion_angles

from .spectra import LiveSpectra

_MOST = 100_000  # rpm
_JUMP = 0.1  # share of the speed; a larger step between two values was not swept through


class MilledSpeeds:
    """Speeds passed so far, to 1 rpm; it takes the same memory whatever comes.

    Examples
    --------
    >>> speeds = MilledSpeeds()
    >>> speeds.add(np.array([400.0, 410.0, 600.0]))
    >>> speeds.passed(404.0, 408.0).all(), speeds.passed(450.0, 460.0).any()
    (np.True_, np.False_)
    """

    def __init__(self) -> None:
        self._passed = np.zeros(_MOST, dtype=bool)
        self._last = float("nan")

    @property
    def known(self) -> bool:
        """Whether any speed was told."""
        return bool(self._passed.any())

    def add(self, values: NDArray[np.float64]) -> None:
        """Take further speeds (rpm) in the order of time."""
        for value in np.clip(np.abs(values[np.isfinite(values)]), 0, _MOST - 1):
            near = abs(value - self._last) <= _JUMP * value
            low, high = sorted((value, self._last)) if near else (value, value)
            self._passed[int(low) : int(high) + 1] = True
            self._last = float(value)

    def passed(self, low: float, high: float) -> NDArray[np.bool_]:
        """Whether each whole speed from ``low`` to ``high`` (rpm) was passed."""
        return self._passed[int(low) : int(high) + 1].copy()


_RPM = math.pi / 30

Immersion = tuple[float, float]
"""Start and exit angle, degrees."""


@dataclass(frozen=True)
class SessionPlan:
    """Sweeps that a session has planned.

    Parameters
    ----------
    immersions : degrees
        Start and exit angle of each test.
    speeds : rpm
        Lowest and highest spindle speed of every sweep.
    duration : s
        Duration of each sweep.
    teeth
        Number of teeth of the cutter.
    """

    immersions: tuple[Immersion, ...]
    speeds: tuple[float, float]
    duration: float
    teeth: int

    @property
    def band(self) -> tuple[float, float]:
        """Frequencies of the tooth passing, Hz."""
        return self.speeds[0] * self.teeth / 60, self.speeds[1] * self.teeth / 60

    def rpm(self, frequency: float) -> float:
        """Spindle speed at which the teeth pass with a frequency (Hz)."""
        return 60 * frequency / self.teeth


def session_plan(plan: SweepPlan) -> SessionPlan:
    """Give a plan of sweeps in the units of the page."""
    first, last = sorted(speed / _RPM for speed in plan.spindle_speeds)
    immersions = tuple((math.degrees(one.start_angle), math.degrees(one.exit_angle)) for one in plan.processes)
    return SessionPlan(immersions, (first, last), plan.duration, plan.processes[0].teeth)


SPEED_EVENTS = "spindle_speed_rpm"
"""Event series of the spindle's speed, rpm."""

_SAME = ("tool", "pose")
_BLOCK = 1 << 15


@dataclass(frozen=True)
class SetUp:
    """What recordings must share to be stacked.

    Parameters
    ----------
    stream
        Channels and sample rate.
    setup
        Set-up, TOML text: tool and pose must be equal, the immersion may differ.
    highest_frequency, segment : Hz and s
        Settings of the spectra.
    """

    stream: StreamDescription
    setup: str
    highest_frequency: float
    segment: float


@dataclass(frozen=True)
class ForcePower:
    """Power of the forces over frequency; of a test that is stacked nothing else is kept.

    Parameters
    ----------
    frequencies : (n_lines,), Hz
        Frequencies of the lines.
    power : (n_lines, n_forces), N^2/Hz
        Power spectral density of each force.
    """

    frequencies: NDArray[np.float64]
    power: NDArray[np.float64]


def force_power(spectra: CrossSpectra | None) -> ForcePower | None:
    """Give the power of the forces of spectra; None where there are none."""
    if spectra is None:
        return None
    return ForcePower(spectra.frequencies, np.real(np.einsum("kii->ki", spectra.input_spectra)).copy())


@dataclass(frozen=True)
class SessionTest:
    """One test of a session.

    Parameters
    ----------
    name
        Name of the recording.
    forces
        Power of its forces; None: it is too short for spectra.
    immersion : degrees
        Start and exit angle; None where it does not say.
    seconds : s
        Duration of its samples.
    speeds
        Spindle speeds that a device told; None: no device did.
    """

    name: str
    forces: ForcePower | None
    immersion: Immersion | None
    seconds: float
    speeds: MilledSpeeds | None = None


def tests_beside(out: Path, pattern: str) -> list[Path]:
    """Recordings beside the one that is written, in the order of their names."""
    if not pattern or not out.parent.is_dir():
        return []
    return sorted(path for path in out.parent.glob(pattern) if path.is_file() and path.resolve() != out.resolve())


def read_test(
    path: Path, wanted: SetUp, stopped: Callable[[], bool] = lambda: False
) -> tuple[SessionTest, CrossSpectra | None]:
    """Read a recording and its spectra, with pauses, so that the recording that runs is not held up.

    Raises
    ------
    InputError
        It is of another set-up, not complete, or no recording.
    """
    with Recording(path) as recording:
        if recording.complete is not True:
            raise InputError("not closed in order")
        stream = next((one for one in recording.streams.values() if _alike(one.description, wanted.stream)), None)
        if stream is None:
            raise InputError("other channels or another sample rate")
        for key in _SAME:
            if _table(recording.setup, key) != _table(wanted.setup, key):
                raise InputError(f"another {key}")
        spectra = LiveSpectra(stream.channels, stream.sample_rate, wanted.highest_frequency, wanted.segment)
        for start in range(0, stream.n_samples, _BLOCK):
            if stopped():
                raise InputError("not read to its end")
            spectra.add(stream.read(start, min(start + _BLOCK, stream.n_samples)))
            time.sleep(0.002)
        grown = spectra.grown()
        seconds = stream.n_samples / stream.sample_rate
        cross = None if grown is None else grown.cross
        immersion = immersion_of(recording.setup)
        return SessionTest(path.name, force_power(cross), immersion, seconds, _speeds(recording)), cross


def _speeds(recording: Recording) -> MilledSpeeds | None:
    if SPEED_EVENTS not in recording.events:
        return None
    speeds = MilledSpeeds()
    speeds.add(recording.events[SPEED_EVENTS].read()[1])
    return speeds if speeds.known else None


def _alike(one: StreamDescription, other: StreamDescription) -> bool:
    """Equal channels at an equal rate; rates that a device makes differ in the last digits."""
    kinds = [[(c.name, c.quantity, c.unit, c.degree_of_freedom) for c in each.channels] for each in (one, other)]
    return kinds[0] == kinds[1] and one.sample_rate == other.sample_rate


def _table(setup: str, name: str) -> dict[str, Any]:
    try:
        found = tomllib.loads(setup).get(name, {})
    except (tomllib.TOMLDecodeError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}


def immersion_of(setup: str) -> Immersion | None:
    """Start and exit angle that a set-up states, degrees, in its table ``cut`` or ``cutting``.

    Examples
    --------
    >>> immersion_of("[cutting]\\nimmersion = 'slot'\\n")
    (0.0, 180.0)
    """
    for name in ("cut", "cutting"):
        table = _table(setup, name)
        start, leave, kind = (table.get(key) for key in ("start_angle_deg", "exit_angle_deg", "immersion"))
        if isinstance(start, int | float) and isinstance(leave, int | float):
            return float(start), float(leave)
        if isinstance(kind, str):
            depth, diameter = table.get("radial_depth_m", 0.0), _table(setup, "cutting").get("diameter_m", 0.0)
            try:
                first, last = immersion_angles(kind, float(depth), float(diameter))
            except (MillfrfError, TypeError, ValueError):
                return None
            return math.degrees(first), math.degrees(last)
    return None
