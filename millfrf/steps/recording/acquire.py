"""Step ``acquire``: record a session, with or without the live page."""

import math
import os
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated

import numpy as np
from annotated_types import Ge, Le

from acquisition import (
    DEVICES,
    Block,
    DeviceError,
    DeviceSummary,
    Events,
    Finishes,
    Session,
    SimulatedDevice,
    Source,
    WithFeeds,
    announced_events,
    build_source,
    device_summary,
    record,
    session_from_text,
    session_text,
)
from millfrf.core import DiskError, InputError, MillfrfError
from millfrf.core.errors import NotKept
from millfrf.core.file_locks import is_marked
from millfrf.core.progress import progress
from millfrf.core.provenance import made
from millfrf.core.steps import File, Reads, Typed, Writes, step
from millfrf.core.terminal import note, say, say_written, show, warn
from millfrf.gate import rate_warnings
from millfrf.live.control import MARKS, LiveControl
from millfrf.live.guard import LOOPBACK
from millfrf.live.monitor import LiveMonitor, LiveSettings
from millfrf.live.server import LiveServer
from millfrf.live.standing import SessionTests
from millfrf.live.tests_of_session import SessionPlan, session_plan

from ..plan import plan_from_file
from ..settings import STEPS
from .signal_check import Preflight, listen, preflight
from .simulated_device import number_in, simulated_device
from .watched_cut import watched_by_page

Watcher = Callable[[Block | Events], None]


@step
def acquire(
    session: Annotated[File, Reads("SESSION.toml")],
    /,
    *,
    out: Annotated[File | None, Writes("REC.h5", suffixes=(".h5", ".hdf5"))] = None,
    check: bool = False,
    seconds: Annotated[float, Ge(0.1)] = 3.0,
    live: bool = False,
    live_address: Annotated[str, Typed("IP")] = LOOPBACK,
    live_port: Annotated[int, Ge(0), Le(65535)] = 0,
    at_once: bool = False,
) -> "Tally | Preflight | None":
    """Record from the devices of a session until its duration is over, Stop is pressed or Ctrl-C.

    Parameters
    ----------
    session
        Session file: what is wired where, and for how long.
    out
        Recording to write.
    check
        Check every channel and record nothing; tap on the structure to check signs.
    seconds : s
        Duration of --check.
    live
        Show the signals on a page; its Start button begins the recording.
    live_address
        Network address of the page; other than 127.0.0.1, other computers see it.
    live_port
        Port of the page; 0 is any free port.
    at_once
        With --live: record without waiting for Start.

    Returns
    -------
    Tally, Preflight or None
        Count of samples and events; with ``check`` the checks of every channel; None if the recording was stopped
        before it was started.

    Raises
    ------
    InputError
        The session has a mistake, or neither ``out`` nor ``check`` is given.
    DeviceError
        A device cannot be set up, or fails; the file is closed with the samples before.

    Examples
    --------
    ::

        $ millfrf acquire session.toml --out rec1.h5 --live
    """
    if (out is None) == (not check):
        raise InputError("give either --out REC.h5 to record or --check to look at the signals first")
    opened = open_session(session)
    for stream in opened.source.streams:
        say(f"stream {stream.name}: {len(stream.channels)} channels at {stream.sample_rate:.9g} Hz")
    for notice in getattr(opened.source, "notices", ()):
        note(f"note: {notice}")
    if out is None:
        return _check(opened.source, seconds)
    if live:
        tally = record_live(opened, out, address=live_address, port=live_port, at_once=at_once)
    else:
        with progress(f"recording {Path(out).name}", opened.source.n_samples) as update:
            tally = record_session(opened, out, progress=update)
    if tally is None:
        say("stopped before Start; nothing was recorded")
        return None
    say(tally.summary())
    story = tally.device_summary()
    for line in (*story.losses, *story.notices):
        say(f"device: {line}")
    say_written([out])
    warn(rate_warnings(out))
    return tally


def _check(source: Source, seconds: float) -> "Preflight":
    """Read a source for some seconds and check its channels; raise an error if a channel has a fault."""
    samples = listen(source, seconds)
    checked = preflight(samples.streams, samples.doubts)
    show(checked.table())
    for tap in checked.taps:
        say(f"tap: {tap.acceleration.name} {1e6 * tap.delay:+.0f} us after {tap.force.name}")
    concerns = checked.concerns()
    for line in concerns:
        say(f"concern: {line}")
    if concerns:
        raise MillfrfError(f"pre-flight: {len(concerns)} concerns about {len(checked.checks)} channels; see above")
    say("pre-flight: nothing wrong")
    return checked


@dataclass(frozen=True)
class OpenedSession:
    """A session with its source, set up but not yet running."""

    session: Session
    source: Source
    path: Path  # session file


@dataclass
class Tally:
    """Count of the recorded samples and events during a recording."""

    rates: dict[str, float]  # sample rate of each stream, Hz
    samples: dict[str, int] = field(default_factory=dict)  # rows by stream
    events: dict[str, int] = field(default_factory=dict)  # values by series
    longest_gap: float = 0.0  # s; longest delay of a block: this computer or the device was held up
    _log: list[Events] = field(default_factory=list)  # of auxiliary devices
    _began: float | None = None  # s, monotonic clock
    _last: dict[str, float] = field(default_factory=dict)  # arrival of the last block of each stream

    def __call__(self, taken: Block | Events) -> None:
        """Count one block or event."""
        if isinstance(taken, Events):
            self.events[taken.series] = self.events.get(taken.series, 0) + len(taken.times)
            if taken.series == DEVICES:
                self._log.append(taken)
            return
        now = time.monotonic()
        if self._began is None:
            self._began = now - len(taken.samples) / self.rates[taken.stream]
        if taken.stream in self._last:
            beyond = now - self._last[taken.stream] - len(taken.samples) / self.rates[taken.stream]
            self.longest_gap = max(self.longest_gap, beyond)
        self._last[taken.stream] = now
        self.samples[taken.stream] = self.samples.get(taken.stream, 0) + len(taken.samples)

    def seconds(self) -> float:
        """Duration of the longest stream, s."""
        return max((n / self.rates[name] for name, n in self.samples.items()), default=0.0)

    def device_summary(self) -> DeviceSummary:
        """Losses and notices of auxiliary devices; times from the first sample by the clock of this computer."""
        lines = [
            (at - (self._began or at), value, text)
            for logged in self._log
            for at, value, text in zip(logged.times, logged.values, logged.texts or (), strict=True)
        ]
        times, values, texts = zip(*lines, strict=True) if lines else ((), (), ())
        return device_summary(np.array(times), np.array(values), texts)

    def summary(self) -> str:
        """Sum the recording up in one line."""
        streams = ", ".join(f"{name}: {n} samples" for name, n in self.samples.items()) or "no samples"
        events = ", ".join(f"{name}: {n} events" for name, n in self.events.items() if name != DEVICES)
        counts = f"{streams}{'; ' if events else ''}{events}; {self.seconds():.2f} s"
        return f"{counts}, longest delay {1e3 * self.longest_gap:.0f} ms"


def open_session(path: str | os.PathLike[str]) -> OpenedSession:
    """Read a session and set its device up."""
    text = session_text(path)
    session = session_from_text(text, os.fspath(path))
    sampled = simulated_device(session, path) if isinstance(session.device, SimulatedDevice) else None
    return OpenedSession(session, build_source(session, text, Path(path).parent, sampled), Path(path))


def record_session(
    opened: OpenedSession,
    out: str | os.PathLike[str],
    *,
    watchers: Sequence[Watcher] = (),
    stop: Callable[[], bool] = lambda: False,
    progress: Callable[[int], None] | None = None,
) -> Tally:
    """Record a session until Ctrl-C, ``stop`` or the session's duration ends it; errors close the file in order.

    ``watchers`` are called with every block and event after it was written, ``stop`` before every block, and
    ``progress`` with the number of samples written.
    """
    tally = Tally({stream.name: stream.sample_rate for stream in opened.source.streams})
    duration = opened.session.duration_s or math.inf

    def observe(taken: Block | Events) -> None:
        tally(taken)
        for watcher in watchers:
            watcher(taken)

    def ended(stopped: bool) -> bool:
        """Whether to end at once; a source that can finish first delivers the samples that it still holds."""
        if stopped and isinstance(opened.source, Finishes):
            opened.source.finish()
            return False
        return stopped

    try:
        with interrupts() as interrupted:
            record(
                opened.source,
                out,
                observer=observe,
                provenance=made("acquire", [opened.path]),
                overwrite=True,
                progress=progress,
                stop=lambda: ended(interrupted() or stop() or tally.seconds() >= duration),
            )
    except (DeviceError, DiskError) as error:
        if not isinstance(error, NotKept) and _is_closed(Path(out)):
            error.args = (f"{error}; {os.fspath(out)} holds the {tally.seconds():.2f} s before",)
        raise
    except KeyboardInterrupt as error:
        raise MillfrfError(f"stopped at once; {os.fspath(out)} holds the {tally.seconds():.2f} s before") from error
    return tally


def _is_closed(recording: Path) -> bool:
    """Return whether a recording was closed in order, so that it holds what was recorded."""
    with suppress(OSError):
        return not is_marked(recording)
    return False


@contextmanager
def interrupts() -> Iterator[Callable[[], bool]]:
    """Function that states whether Ctrl-C or SIGTERM came; a second Ctrl-C interrupts at once."""
    interrupted = False

    def handle(number: int, frame: object) -> None:
        nonlocal interrupted
        if interrupted:
            raise KeyboardInterrupt
        interrupted = True

    try:
        before = {number: signal.signal(number, handle) for number in (signal.SIGINT, signal.SIGTERM)}
    except ValueError:  # only the main thread may handle signals
        before = {}
    try:
        yield lambda: interrupted
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


_LINGER = 3.0  # s that the page is still served after the end, so that open browsers show the result


def live_settings(session: Session, plan: SessionPlan | None = None) -> LiveSettings:
    """Settings of the page from the session's tables ``live``, ``plan``, ``cutting``, ``tool`` and ``cut``."""
    teeth = number_in(session.cutting, "teeth") or number_in(session.tool, "teeth")
    resolution = number_in(session.plan, "resolution_hz")
    return LiveSettings(
        session.band_hz,
        session.live.segment_s or (2 / resolution if plan is not None and resolution > 0 else 1.0),
        session.live.frf_error,
        number_in(session.plan, "frf_error_m_per_n") or None,
        session.live.bands,
        int(teeth),
        number_in(session.cut, "spindle_speed_rpm"),
        None if plan is None else plan.band,
    )


def session_tests(opened: OpenedSession, out: str | os.PathLike[str]) -> SessionTests:
    """Tests of the session in the folder of a recording, and the plan if the session has one."""
    plan, note = None, ""
    if opened.session.plan:
        try:
            plan = session_plan(plan_from_file(opened.path)[0])
        except MillfrfError as error:
            note = f"no plan: {error}"
    return SessionTests(Path(out), opened.session.live.tests, opened.source.setup, plan, note)


def record_live(
    opened: OpenedSession,
    out: str | os.PathLike[str],
    *,
    address: str = LOOPBACK,
    port: int = 0,
    at_once: bool = False,
) -> Tally | None:
    """Show a session's signals on a page and record them from Start to Stop; None if stopped before Start."""
    replayed = announced_events(opened.source)
    control = LiveControl(MARKS if MARKS not in replayed else f"{MARKS}_while_replaying")
    tests = session_tests(opened, out)
    watching = watched_by_page(opened.session, opened.source)
    monitor = LiveMonitor(opened.source.streams, live_settings(opened.session, tests.plan), tests, watching)
    judges = [] if watching is None else [watching]
    try:
        with LiveServer(monitor, control, address, port) as server:
            say(f"live page: {server.url}")
            try:
                if not at_once and not _preview(opened.source, monitor, control):
                    return None
                control.start()
                monitor.restart()
                source = WithFeeds(opened.source, [control, *judges])
                tally = record_session(
                    replace(opened, source=source),
                    out,
                    watchers=[monitor, *judges],
                    stop=lambda: control.state == "stopping",
                )
                monitor.finish()
                control.ended("; ".join([f"Wrote {os.fspath(out)}: {tally.summary()}", *tally.device_summary().losses]))
            except MillfrfError as error:
                control.ended(f"Ended by an error: {error}")
                raise
            finally:
                with suppress(KeyboardInterrupt):  # the file is closed: an interrupt loses no data
                    time.sleep(_LINGER)
            return tally
    finally:
        monitor.close()
        for judge in judges:
            judge.close()


def _preview(source: Source, monitor: LiveMonitor, control: LiveControl) -> bool:
    """Show the signals without recording them; return True after Start, False after Stop or Ctrl-C."""
    with interrupts() as interrupted:
        try:
            source.open()
            while control.state == "waiting" and not interrupted():
                taken = source.read()
                if taken is None:  # a file or a simulation ended before Start: show it again
                    source.close()
                    time.sleep(STEPS.preview_pause)
                    monitor.forget()
                    source.open()
                else:
                    monitor(taken)
        finally:
            source.close()
        return not interrupted() and control.state != "stopping"
