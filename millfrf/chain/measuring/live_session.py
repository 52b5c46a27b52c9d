"""Recording with the live page: signals are shown at once, recorded from Start to Stop."""

import os
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from acquisition import Session, Source, WithFeeds, announced_events
from millfrf.core import MillfrfError

from ...live import (
    LOOPBACK,
    MARKS,
    LiveControl,
    LiveMonitor,
    LiveServer,
    LiveSettings,
    SessionPlan,
    SessionTests,
    session_plan,
)
from .plan import plan_from_file
from .record_session import OpenedSession, Tally, acquire, interrupts

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


def acquire_live(
    opened: OpenedSession,
    out: str | os.PathLike[str],
    *,
    address: str = LOOPBACK,
    port: int = 0,
    at_once: bool = False,
    overwrite: bool = False,
    say: Callable[[str], object] = str,
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
    overwrite
        Whether a recording of that name may be replaced.
    say
        Function that is told the page's address.

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
                tally = acquire(replace(opened, source=source), out, watchers=[monitor], stop=stop, overwrite=overwrite)
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
