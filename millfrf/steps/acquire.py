"""Step ``acquire``: record a session, with or without the live page."""

import math
import os
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from annotated_types import Ge, Le

from acquisition import (
    DEVICES,
    Block,
    DeviceError,
    DeviceStory,
    Events,
    Finishes,
    Session,
    SimulatedDevice,
    Source,
    WithFeeds,
    announced_events,
    build_source,
    device_story,
    record,
    session_from_text,
    session_text,
)
from millfrf.core import DiskFull, InputError, MillfrfError
from millfrf.core.progress import progress
from millfrf.core.provenance import made
from millfrf.core.steps import File, Reads, Typed, Writes, step
from millfrf.core.terminal import note, say, say_written, show, warn
from millfrf.gate import doubts_of_rate
from millfrf.live.control import MARKS, LiveControl
from millfrf.live.guard import LOOPBACK
from millfrf.live.monitor import LiveMonitor, LiveSettings
from millfrf.live.server import LiveServer
from millfrf.live.standing import SessionTests
from millfrf.live.tests_of_session import SessionPlan, session_plan

from .plan import plan_from_file
from .signal_check import Preflight, listen, preflight
from .simulated_device import simulated_device

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
        Listen, judge every channel and record nothing; tap to check signs.
    seconds : s
        How long --check listens.
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
        Count of samples and events; with ``check`` the judgement of every channel; None where the recording was
        stopped before it was started.

    Raises
    ------
    InputError
        The session has a mistake, or neither ``out`` nor ``check`` is given.
    DeviceError
        A device cannot be set up, or fails; the file is closed and holds what came before.

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
    story = tally.device_story()
    for line in (*story.losses, *story.notices):
        say(f"device: {line}")
    say_written([out])
    warn(doubts_of_rate(out))
    return tally


def _check(source: Source, seconds: float) -> "Preflight":
    """Listen to a source and judge its channels; concerns end the command with an error."""
    heard = listen(source, seconds)
    checked = preflight(heard.streams, heard.doubts)
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
    """A session with its source, set up but not yet running.

    Parameters
    ----------
    session, source, path
        What was read, what it describes, and the file that it was read from.
    """

    session: Session
    source: Source
    path: Path


@dataclass
class Tally:
    """Count of the recorded samples and events, kept while they come.

    Parameters
    ----------
    samples
        Rows by stream.
    events
        Values by series.
    longest_gap
        Longest time between two blocks of a stream beyond the block's own duration, s: how long this computer or the
        device held the recording up.
    """

    rates: dict[str, float]
    samples: dict[str, int] = field(default_factory=dict)
    events: dict[str, int] = field(default_factory=dict)
    longest_gap: float = 0.0
    _log: list[Events] = field(default_factory=list)
    _began: float | None = None
    _last: dict[str, float] = field(default_factory=dict)

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

    def device_story(self) -> DeviceStory:
        """What happened to auxiliary devices; times since the first sample, as well as this computer was prompt."""
        lines = [
            (at - (self._began or at), value, text)
            for one in self._log
            for at, value, text in zip(one.times, one.values, one.texts or (), strict=True)
        ]
        times, values, texts = zip(*lines, strict=True) if lines else ((), (), ())
        return device_story(np.array(times), np.array(values), texts)

    def summary(self) -> str:
        """Sum the recording up in one line."""
        streams = ", ".join(f"{name}: {n} samples" for name, n in self.samples.items()) or "no samples"
        events = ", ".join(f"{name}: {n} events" for name, n in self.events.items() if name != DEVICES)
        said = f"{streams}{'; ' if events else ''}{events}; {self.seconds():.2f} s"
        return f"{said}, longest delay {1e3 * self.longest_gap:.0f} ms"


def open_session(path: str | os.PathLike[str]) -> OpenedSession:
    """Read a session and set its device up.

    Raises
    ------
    InputError
        The file has a mistake.
    DeviceError
        The device cannot be set up.
    """
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
    """Record a session; Ctrl-C, ``stop`` and the session's duration end it in order.

    Parameters
    ----------
    opened
        Session whose devices are set up, from `open_session`.
    out
        New file to write.
    watchers
        Functions that are shown every block and event after it was written.
    stop
        Function that is asked before every block; True ends the recording.
    progress
        Function that is called with the number of samples written.

    Raises
    ------
    InputError, DeviceError, DiskFull, MillfrfError
        The file is closed and holds what came before; the last where it was interrupted twice.
    """
    tally = Tally({stream.name: stream.sample_rate for stream in opened.source.streams})
    duration = opened.session.duration_s or math.inf

    def observe(taken: Block | Events) -> None:
        tally(taken)
        for watcher in watchers:
            watcher(taken)

    def ended(asked: bool) -> bool:
        """Whether to end at once; one that finishes is asked to, so that it can tell the rest."""
        if asked and isinstance(opened.source, Finishes):
            opened.source.finish()
            return False
        return asked

    try:
        with interrupts() as interrupted:
            record(
                opened.source,
                out,
                observer=observe,
                provenance=made("acquire", [opened.path]),
                overwrite=True,
                stop=lambda: ended(interrupted() or stop() or tally.seconds() >= duration),
            )
    except (DeviceError, DiskFull) as error:
        error.args = (f"{error}; {_kept(tally, out)}",)
        raise
    except KeyboardInterrupt as error:
        raise MillfrfError(f"stopped at once; {_kept(tally, out)}") from error
    return tally


def _kept(tally: Tally, out: str | os.PathLike[str]) -> str:
    """Say what a recording holds that ended too early."""
    return f"{os.fspath(out)} holds the {tally.seconds():.2f} s before"


@contextmanager
def interrupts() -> Iterator[Callable[[], bool]]:
    """Ctrl-C and SIGTERM as a question that is asked between blocks; a second Ctrl-C interrupts at once."""
    asked = False

    def ask(number: int, frame: object) -> None:
        nonlocal asked
        if asked:
            raise KeyboardInterrupt
        asked = True

    try:
        before = {number: signal.signal(number, ask) for number in (signal.SIGINT, signal.SIGTERM)}
    except ValueError:  # not the main thread: signals are somebody else's
        before = {}
    try:
        yield lambda: asked
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


_PAUSE = 0.2  # s between two previews of a source that ends
_LINGER = 3.0  # s in which open pages learn how it ended


def live_settings(session: Session, plan: SessionPlan | None = None) -> LiveSettings:
    """Give the settings of the page from the session's tables ``live``, ``plan``, ``cutting``, ``tool`` and ``cut``."""
    teeth = _number(session.cutting, "teeth") or _number(session.tool, "teeth")
    resolution = _number(session.plan, "resolution_hz")
    return LiveSettings(
        session.band_hz,
        session.live.segment_s or (2 / resolution if plan is not None and resolution > 0 else 1.0),
        session.live.frf_error,
        _number(session.plan, "frf_error_m_per_n") or None,
        session.live.bands,
        int(teeth),
        _number(session.cut, "spindle_speed_rpm"),
        None if plan is None else plan.band,
    )


def session_tests(opened: OpenedSession, out: str | os.PathLike[str]) -> SessionTests:
    """Tests of the session that a recording belongs to: those beside it, and the plan where there is one."""
    plan, note = None, ""
    if opened.session.plan:
        try:
            plan = session_plan(plan_from_file(opened.path)[0])
        except MillfrfError as error:
            note = f"no plan: {error}"
    return SessionTests(Path(out), opened.session.live.tests, opened.source.setup, plan, note)


def _number(table: dict[str, Any], key: str) -> float:
    value = table.get(key, 0)
    return float(value) if isinstance(value, int | float) else 0.0


def record_live(
    opened: OpenedSession,
    out: str | os.PathLike[str],
    *,
    address: str = LOOPBACK,
    port: int = 0,
    at_once: bool = False,
) -> Tally | None:
    """Show a session's signals on a page and record them from Start to Stop.

    Parameters
    ----------
    opened
        Session whose devices are set up, from `open_session`.
    out
        New file to write.
    address, port
        Network address and port of the page.
    at_once
        Whether to record without waiting for Start.

    Returns
    -------
    Tally or None
        None where it was stopped before it was started.

    Raises
    ------
    InputError, DeviceError, DiskFull
        The file is closed and holds what came before.
    """
    replayed = announced_events(opened.source)
    control = LiveControl(MARKS if MARKS not in replayed else f"{MARKS}_while_replaying")
    tests = session_tests(opened, out)
    monitor = LiveMonitor(opened.source.streams, live_settings(opened.session, tests.plan), tests)
    try:
        with LiveServer(monitor, control, address, port) as server:
            say(f"live page: {server.url}")
            try:
                if not at_once and not _preview(opened.source, monitor, control):
                    return None
                control.start()
                monitor.restart()
                source = WithFeeds(opened.source, [control])
                stop = _stopping(control)
                tally = record_session(replace(opened, source=source), out, watchers=[monitor], stop=stop)
                monitor.finish()
                control.ended("; ".join([f"Wrote {os.fspath(out)}: {tally.summary()}", *tally.device_story().losses]))
            except MillfrfError as error:
                control.ended(f"Ended by an error: {error}")
                raise
            finally:
                with suppress(KeyboardInterrupt):  # the file is closed: whoever is in a hurry loses nothing
                    time.sleep(_LINGER)
            return tally
    finally:
        monitor.close()


def _preview(source: Source, monitor: LiveMonitor, control: LiveControl) -> bool:
    """Show what comes, and keep nothing, until Start (True) or Stop or Ctrl-C (False)."""
    with interrupts() as interrupted:
        try:
            source.open()
            while control.state == "waiting" and not interrupted():
                taken = source.read()
                if taken is None:  # a file or a simulation is over before anybody has pressed Start: show it again
                    source.close()
                    time.sleep(_PAUSE)
                    monitor.forget()
                    source.open()
                else:
                    monitor(taken)
        finally:
            source.close()
        return not interrupted() and control.state != "stopping"


def _stopping(control: LiveControl) -> Callable[[], bool]:
    return lambda: control.state == "stopping"
