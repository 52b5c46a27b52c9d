"""Progress of a session, test by test, and what to do next."""

import math
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from estimation import CrossSpectra, sum_tests
from millfrf.core import MillfrfError

from .spectra import BandProgress
from .tests_of_session import (
    Immersion,
    MilledSpeeds,
    SessionPlan,
    SessionTest,
    SetUp,
    force_power,
    immersion_of,
    read_test,
    tests_beside,
)

NEAR_DEG = 3.0  # degrees; largest difference between milled and planned immersion
COVERED = 0.95  # share of the planned speeds from which a sweep is complete
DRIVEN = 1e-4  # share of the largest power in the band from which a line is driven
_STRONG = 0.1  # the same without a measured speed, because runout drives other lines too
_NARROW = 0.01  # share of the speeds; narrower gaps lie between two values of the speed
_TINY = 1e-300
_OUT_OF_REACH = 8 * 3600.0  # s
COLUMNS = ("immersion (°)", "recordings", "speeds milled (rpm)", "time (s)", "state")

State = Literal["done", "running", "missing", "other"]


@dataclass(frozen=True)
class TestRow:
    """One row of the table of tests."""

    state: State  # other: not in the plan
    cells: tuple[str, ...]  # in the order of `COLUMNS`


@dataclass(frozen=True)
class Standing:
    """Progress of a session."""

    rows: tuple[TestRow, ...]  # planned tests, then further tests
    advice: str  # missing tests and remaining time


def standing_of(
    plan: SessionPlan | None,
    earlier: Sequence[SessionTest],
    running: SessionTest | None,
    bands: Sequence[BandProgress],
    frf_known: bool,
) -> Standing:
    """Compare the tests of a session with its plan."""
    tests = [*earlier, *([running] if running else [])]
    if plan is None:
        rows = [_row(test.immersion, [test], None, running) for test in tests]
        return Standing(tuple(rows), _without_plan(tests, bands, frf_known))
    groups = {immersion: [test for test in tests if _near(test, immersion)] for immersion in plan.immersions}
    others = [test for test in tests if not any(test in group for group in groups.values())]
    rows = [_row(immersion, group, plan, running) for immersion, group in groups.items()]
    rows += [_row(test.immersion, [test], plan, running, planned=False) for test in others]
    return Standing(tuple(rows), _advice(plan, groups, others, running, bands))


def _near(test: SessionTest, immersion: Immersion) -> bool:
    return (
        test.immersion is not None
        and max(abs(test.immersion[0] - immersion[0]), abs(test.immersion[1] - immersion[1])) <= NEAR_DEG
    )


def _row(
    immersion: Immersion | None,
    group: Sequence[SessionTest],
    plan: SessionPlan | None,
    running: SessionTest | None,
    planned: bool = True,
) -> TestRow:
    shown_angles = "not stated" if immersion is None else angles(immersion)
    names = ", ".join(test.name for test in group)
    seconds = sum(test.seconds for test in group)
    if plan is None or not planned:
        state: State = "running" if running in group else "other"
        shown_state = "running" if state == "running" else ("recorded" if plan is None else "not in the plan")
        return TestRow(state, (shown_angles, names, "", f"{seconds:.0f}", shown_state))
    share, gaps = coverage(plan, group)
    state = "running" if running in group else "done" if share >= COVERED else "missing"
    shown_state = {"running": "running", "done": "done", "missing": "missing" if not group else "speeds missing"}[state]
    speeds = f"all of {_range(plan.speeds)}" if share >= COVERED else _milled(plan, gaps)
    return TestRow(
        state, (shown_angles, names, speeds if group else "", f"{seconds:.0f} of {plan.duration:.0f}", shown_state)
    )


def angles(immersion: Immersion) -> str:
    """Format the start and exit angle of an immersion.

    Examples
    --------
    >>> angles((67.5, 112.5))
    '67.5 to 112.5'
    """
    return f"{immersion[0]:.4g} to {immersion[1]:.4g}"


def _range(speeds: tuple[float, float]) -> str:
    return f"{speeds[0]:.0f} to {speeds[1]:.0f}"


def coverage(plan: SessionPlan, group: Sequence[SessionTest]) -> tuple[float, list[tuple[float, float]]]:
    """Return the share of the planned speeds that were milled, and the ranges (rpm) that were not milled.

    A speed is milled if the force has power at its tooth-passing frequency and, with a measured speed, if the spindle
    has passed it. Without a measured speed, the power must be at least a tenth of the largest power, because runout
    drives other lines.
    """
    axis = np.arange(math.ceil(plan.speeds[0]), math.floor(plan.speeds[1]) + 1)
    milled = np.zeros(len(axis), dtype=bool)
    for test in group:
        milled |= _milled_by(test, axis, plan)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], ~milled, [False]]).astype(int)))
    wide = _NARROW * len(axis)  # rpm
    gaps = [(float(axis[a]), float(axis[b - 1])) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a > wide]
    return 1.0 - sum(high - low + 1 for low, high in gaps) / len(axis), gaps


def _milled_by(test: SessionTest, axis: NDArray[np.int64], plan: SessionPlan) -> NDArray[np.bool_]:
    """Return whether a test has milled each speed (rpm)."""
    if test.forces is None:
        return np.zeros(len(axis), dtype=bool)
    passing, f, power = axis * plan.teeth / 60, test.forces.frequencies, test.forces.power
    inside = (f >= 0.9 * plan.band[0]) & (f <= 1.1 * plan.band[1])
    if not inside.any():
        return np.zeros(len(axis), dtype=bool)
    share = np.max(power / np.maximum(power[inside].max(axis=0), _TINY), axis=1)
    at_passing = np.interp(passing, f, share)
    if test.speeds is None:
        return np.asarray(at_passing >= _STRONG)
    return np.asarray(test.speeds.passed(axis[0], axis[-1]) & (at_passing >= DRIVEN))


def _milled(plan: SessionPlan, gaps: Sequence[tuple[float, float]]) -> str:
    """Describe the milled ranges of speed between the gaps."""
    edges = [plan.speeds[0], *(edge for gap in gaps for edge in gap), plan.speeds[1]]
    pairs = [pair for pair in zip(edges[::2], edges[1::2], strict=True) if pair[1] - pair[0] > 1.0]
    return ", ".join(_range(pair) for pair in pairs) or "none yet"


def _advice(
    plan: SessionPlan,
    groups: dict[Immersion, list[SessionTest]],
    others: Sequence[SessionTest],
    running: SessionTest | None,
    bands: Sequence[BandProgress],
) -> str:
    """Describe the next step: finish this sweep, mill missing immersions, continue, or stop."""
    sentences = []
    if running is not None and running in others:
        stated = "states no immersion" if running.immersion is None else f"has {angles(running.immersion)}°"
        sentences.append(f"This test {stated}, which is not in the plan.")
    for immersion, group in groups.items():
        share, gaps = coverage(plan, group)
        if share >= COVERED or not group:
            continue
        remaining = sum(high - low for low, high in gaps) / (plan.speeds[1] - plan.speeds[0]) * plan.duration
        what = ", ".join(_range(gap) for gap in gaps[:3]) + (" and more" if len(gaps) > 3 else "")
        go_on = "Go on" if running in group else f"In {angles(immersion)}°"
        sentences.append(f"{go_on}: {what} rpm is missing, about {max(remaining, 1):.0f} s.")
    unmilled = [immersion for immersion, group in groups.items() if not group]
    if unmilled:
        where = ", ".join(f"{angles(immersion)}°" for immersion in unmilled)
        sentences.append(f"Still missing: immersion {where}, {plan.duration:.0f} s each.")
    if sentences:
        return " ".join(sentences)
    return _until_enough(bands, [test for group in groups.values() for test in group])


def _until_enough(bands: Sequence[BandProgress], tests: Sequence[SessionTest]) -> str:
    """Estimate the remaining time of milling; the error falls with the square root of time."""
    known = [band for band in bands if math.isfinite(band.error)]
    if not known:
        return "No FRF yet: too few segments."
    if all(band.enough for band in known):
        return "Enough: every band reaches the planned error."
    worst = max(known, key=lambda band: band.error)
    spent = sum(test.seconds for test in tests)
    more = spent * (max(worst.error, 1.0) ** 2 - 1)
    where = f"{worst.low:.4g} to {worst.high:.4g} Hz"
    if more > _OUT_OF_REACH:
        return (
            f"The error at {where} is {worst.error:.2g} times the planned one, and more time will not reduce it "
            "enough: check the coherence, cut deeper, or sweep more slowly."
        )
    if more < 1:
        return f"Nearly enough: some lines of {where} miss the planned error."
    return (
        f"Go on for about {_duration(more)} in all, shared by the immersions: the error at {where} is "
        f"{worst.error:.2g} times the planned one."
    )


def _duration(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 120 else f"{seconds / 60:.0f} min"


def _without_plan(tests: Sequence[SessionTest], bands: Sequence[BandProgress], frf_known: bool) -> str:
    if not tests:
        return ""
    if not frf_known:
        count = f"{len(tests)} test{'s' if len(tests) > 1 else ''}"
        return (
            f"The forces are not independent in {count}: mill another immersion with a sweep of the speed. "
            "With [plan] in the session this page says which."
        )
    return _until_enough(bands, tests)


class SessionTests:
    """Tests of one session: the running test, earlier tests in the same folder, and the plan."""

    def __init__(self, out: Path, pattern: str, setup: str, plan: SessionPlan | None = None, note: str = "") -> None:
        self.plan, self._out, self._pattern, self._setup = plan, out, pattern, setup
        self._notes = [note] if note else []
        self._earlier: list[SessionTest] = []
        self._total: CrossSpectra | None = None
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._reading = ""

    @property
    def setup(self) -> str:
        return self._setup

    @property
    def earlier(self) -> tuple[SessionTest, ...]:
        return tuple(self._earlier)

    @property
    def total(self) -> CrossSpectra | None:
        """Sum of the spectra of all tests read so far; the memory does not depend on their number."""
        return self._total

    @property
    def notes(self) -> tuple[str, ...]:
        """Recordings that are not averaged, with reasons, and the recording that is being read."""
        return (*self._notes, *([self._reading] if self._reading else []))

    def read(self, required: SetUp) -> None:
        """Start to read the earlier tests in a separate thread."""
        paths = tests_beside(self._out, self._pattern)
        if paths:
            self._thread = threading.Thread(
                target=self._read, args=(paths, required), name="earlier tests", daemon=True
            )
            self._thread.start()

    def _read(self, paths: Sequence[Path], required: SetUp) -> None:
        for path in paths:
            if self._stop.is_set():
                return
            self._reading = f"reading {path.name} ..."
            try:
                test, spectra = read_test(path, required, self._stop.is_set)
                if spectra is not None:
                    self._total = spectra if self._total is None else sum_tests([self._total, spectra])
                self._earlier.append(test)
            except (MillfrfError, OSError) as error:
                self._notes.append(f"{path.name} is not stacked: {error}")
            self._reading = ""

    def wait(self) -> None:
        """Wait until all tests are read."""
        if self._thread is not None:
            self._thread.join()

    def running(self, spectra: CrossSpectra | None, seconds: float, speeds: MilledSpeeds) -> SessionTest:
        """Return the running test from its spectra, duration (s) and speeds so far."""
        measured_speeds = speeds if speeds.known else None
        return SessionTest(self._out.name, force_power(spectra), immersion_of(self._setup), seconds, measured_speeds)

    def standing(
        self, current: SessionTest | None, ended: bool, bands: Sequence[BandProgress], frf_known: bool
    ) -> Standing:
        """Return the progress with the current test, see :func:`standing_of`."""
        earlier = [*self._earlier, *([current] if current is not None and ended else [])]
        return standing_of(self.plan, earlier, None if ended else current, bands, frf_known)

    def close(self) -> None:
        """Stop reading."""
        self._stop.set()
        self.wait()
