"""Tests of a session: earlier, running and planned ones."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquisition import Recording, StreamDescription
from estimation import CrossSpectra, SweepPlan
from millfrf.core import InputError, MillfrfError, tables_of_setup
from millfrf.cutting import immersion_angles

from .spectra import LiveSpectra

_HIGHEST_RPM = 100_000
_JUMP = 0.1  # share of the speed; a larger step between two values is no sweep


class MilledSpeeds:
    """Spindle speeds passed so far, with 1 rpm resolution and constant memory.

    Examples
    --------
    >>> speeds = MilledSpeeds()
    >>> speeds.add(np.array([400.0, 410.0, 600.0]))
    >>> speeds.passed(404.0, 408.0).all(), speeds.passed(450.0, 460.0).any()
    (np.True_, np.False_)
    """

    def __init__(self) -> None:
        self._passed = np.zeros(_HIGHEST_RPM, dtype=bool)
        self._last = float("nan")

    @property
    def known(self) -> bool:
        return bool(self._passed.any())

    def add(self, values: NDArray[np.float64]) -> None:
        """Add speeds (rpm) in the order of time."""
        for value in np.clip(np.abs(values[np.isfinite(values)]), 0, _HIGHEST_RPM - 1):
            near = abs(value - self._last) <= _JUMP * value
            low, high = sorted((value, self._last)) if near else (value, value)
            self._passed[int(low) : int(high) + 1] = True
            self._last = float(value)

    def passed(self, low: float, high: float) -> NDArray[np.bool_]:
        """Return whether each integer speed from ``low`` to ``high`` (rpm) was passed."""
        return self._passed[int(low) : int(high) + 1].copy()


_RPM = math.pi / 30

Immersion = tuple[float, float]  # start and exit angle, degrees


@dataclass(frozen=True)
class SessionPlan:
    """Planned sweeps of a session."""

    immersions: tuple[Immersion, ...]  # degrees
    speeds: tuple[float, float]  # rpm; lowest and highest
    duration: float  # s, of each sweep
    teeth: int  # of the cutter

    @property
    def band(self) -> tuple[float, float]:
        """Range of the tooth-passing frequency, Hz."""
        return self.speeds[0] * self.teeth / 60, self.speeds[1] * self.teeth / 60

    def rpm(self, frequency: float) -> float:
        """Return the spindle speed of a tooth-passing frequency (Hz)."""
        return 60 * frequency / self.teeth


def session_plan(plan: SweepPlan) -> SessionPlan:
    """Convert a plan of sweeps to rpm and degrees."""
    first, last = sorted(speed / _RPM for speed in plan.spindle_speeds)
    immersions = tuple(
        (math.degrees(process.start_angle), math.degrees(process.exit_angle)) for process in plan.processes
    )
    return SessionPlan(immersions, (first, last), plan.duration, plan.processes[0].teeth)


SPEED_EVENTS = "spindle_speed_rpm"  # event series of the spindle's speed, rpm
_EQUAL_TABLES = ("tool", "pose")  # tables of the set-up that must be equal
_BLOCK = 1 << 15  # samples read at once


@dataclass(frozen=True)
class SetUp:
    """Properties that recordings must share to be averaged."""

    stream: StreamDescription
    setup: str  # TOML text: tool and pose must be equal, the immersion may differ
    highest_frequency: float  # Hz
    segment: float  # s


@dataclass(frozen=True)
class ForcePower:
    """Power of the forces over frequency; of an averaged test, only this power is kept."""

    frequencies: NDArray[np.float64]  # (n_lines,), Hz
    power: NDArray[np.float64]  # (n_lines, n_forces), N^2/Hz


def force_power(spectra: CrossSpectra | None) -> ForcePower | None:
    """Return the power of the forces from the spectra of a test; None without spectra."""
    if spectra is None:
        return None
    return ForcePower(spectra.frequencies, np.real(np.einsum("kii->ki", spectra.input_spectra)).copy())


@dataclass(frozen=True)
class SessionTest:
    """One test of a session."""

    name: str  # of the recording
    forces: ForcePower | None  # None: too short for spectra
    immersion: Immersion | None  # degrees; None: not stated
    seconds: float  # s
    speeds: MilledSpeeds | None = None  # None: no device measured the speed


def tests_beside(out: Path, pattern: str) -> list[Path]:
    """Return the other recordings in the folder, sorted by name."""
    if not pattern or not out.parent.is_dir():
        return []
    return sorted(path for path in out.parent.glob(pattern) if path.is_file() and path.resolve() != out.resolve())


def read_test(
    path: Path, required: SetUp, stopped: Callable[[], bool] = lambda: False
) -> tuple[SessionTest, CrossSpectra | None]:
    """Read a recording and its spectra, with pauses that leave time for the running recording."""
    with Recording(path) as recording:
        if recording.complete is not True:
            raise InputError("the file was not closed")
        stream = next(
            (
                candidate
                for candidate in recording.streams.values()
                if _equal_streams(candidate.description, required.stream)
            ),
            None,
        )
        if stream is None:
            raise InputError("other channels or another sample rate")
        for key in _EQUAL_TABLES:
            if tables_of_setup(recording.setup).get(key, {}) != tables_of_setup(required.setup).get(key, {}):
                raise InputError(f"another {key}")
        spectra = LiveSpectra(stream.channels, stream.sample_rate, required.highest_frequency, required.segment)
        for start in range(0, stream.n_samples, _BLOCK):
            if stopped():
                raise InputError("reading was stopped")
            spectra.add(stream.read(start, min(start + _BLOCK, stream.n_samples)))
            time.sleep(0.002)
        spectra_so_far = spectra.grown()
        seconds = stream.n_samples / stream.sample_rate
        cross = None if spectra_so_far is None else spectra_so_far.cross
        immersion = immersion_of(recording.setup)
        return SessionTest(path.name, force_power(cross), immersion, seconds, _speeds(recording)), cross


def _speeds(recording: Recording) -> MilledSpeeds | None:
    if SPEED_EVENTS not in recording.events:
        return None
    speeds = MilledSpeeds()
    speeds.add(recording.events[SPEED_EVENTS].read()[1])
    return speeds if speeds.known else None


def _equal_streams(first: StreamDescription, second: StreamDescription) -> bool:
    """Return whether channels and sample rates are equal."""
    kinds = [
        [(c.name, c.quantity, c.unit, c.degree_of_freedom) for c in description.channels]
        for description in (first, second)
    ]
    return kinds[0] == kinds[1] and first.sample_rate == second.sample_rate


def immersion_of(setup: str) -> Immersion | None:
    """Read start and exit angle (degrees) from the table ``cut`` or ``cutting`` of a set-up.

    Examples
    --------
    >>> immersion_of("[cutting]\\nimmersion = 'slot'\\n")
    (0.0, 180.0)
    """
    tables = tables_of_setup(setup)
    for name in ("cut", "cutting"):
        table = tables.get(name, {})
        start, leave, kind = (table.get(key) for key in ("start_angle_deg", "exit_angle_deg", "immersion"))
        if isinstance(start, int | float) and isinstance(leave, int | float):
            return float(start), float(leave)
        if isinstance(kind, str):
            depth, diameter = table.get("radial_depth_m", 0.0), tables.get("cutting", {}).get("diameter_m", 0.0)
            try:
                first, last = immersion_angles(kind, float(depth), float(diameter))
            except (MillfrfError, TypeError, ValueError):
                return None
            return math.degrees(first), math.degrees(last)
    return None
