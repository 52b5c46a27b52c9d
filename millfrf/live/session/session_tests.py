"""`SessionTests`: the tests of a session as the page knows them, read in the background while a recording runs."""

import threading
from collections.abc import Sequence
from pathlib import Path

from estimation import CrossSpectra, sum_tests
from millfrf.core import MillfrfError

from ..enough import BandProgress
from .earlier_tests import SessionTest, SetUp, force_power, immersion_of, read_test, tests_beside
from .milled_speeds import MilledSpeeds
from .planned_sweeps import SessionPlan
from .standing import Standing, standing_of


class SessionTests:
    """Tests of one session: those in the folder of the running one, and the plan.

    Parameters
    ----------
    out
        Recording that is written.
    pattern
        Pattern of the names of the recordings beside it that are stacked; "" for none.
    setup
        Set-up of the running recording, TOML text.
    plan
        What was planned; None: nothing was.
    note
        What else the user shall know, such as why there is no plan.
    """

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
        """Set-up of the running recording."""
        return self._setup

    @property
    def earlier(self) -> tuple[SessionTest, ...]:
        """Tests that were read so far."""
        return tuple(self._earlier)

    @property
    def total(self) -> CrossSpectra | None:
        """Spectra of the tests that were read so far, summed: their number does not cost memory."""
        return self._total

    @property
    def notes(self) -> tuple[str, ...]:
        """Recordings that are not stacked and why, and what is being read."""
        return (*self._notes, *([self._reading] if self._reading else []))

    def read(self, wanted: SetUp) -> None:
        """Begin to read, in a thread of its own."""
        paths = tests_beside(self._out, self._pattern)
        if paths:
            self._thread = threading.Thread(target=self._read, args=(paths, wanted), name="earlier tests", daemon=True)
            self._thread.start()

    def _read(self, paths: Sequence[Path], wanted: SetUp) -> None:
        for path in paths:
            if self._stop.is_set():
                return
            self._reading = f"reading {path.name} ..."
            try:
                test, spectra = read_test(path, wanted, self._stop.is_set)
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
        """The running test with its name and immersion, its spectra, duration (s) and speeds so far."""
        told = speeds if speeds.known else None
        return SessionTest(self._out.name, force_power(spectra), immersion_of(self._setup), seconds, told)

    def standing(
        self, now: SessionTest | None, ended: bool, bands: Sequence[BandProgress], frf_known: bool
    ) -> Standing:
        """How far the session is with the test that runs or has ended; see :func:`standing_of`."""
        earlier = [*self._earlier, *([now] if now is not None and ended else [])]
        return standing_of(self.plan, earlier, None if ended else now, bands, frf_known)

    def close(self) -> None:
        """End the reading."""
        self._stop.set()
        self.wait()
