"""Step ``watch``: verdicts on a cut while it is recorded."""

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from typing import Annotated

from annotated_types import Ge, Le

from acquisition import WithFeeds
from millfrf.core import MillfrfError, counted
from millfrf.core.progress import progress
from millfrf.core.steps import File, Names, Reads, Typed, Writes, names_of, step
from millfrf.core.terminal import say, say_written, tell, warn
from millfrf.live.cell_messages import CellMessages, message_of
from millfrf.live.chatter_watch import Announcement, ChatterWatch

from ..chatter import cut_options
from ..given import ModelGiven
from .acquire import OpenedSession, interrupts, open_session, record_session
from .watched_cut import chatter_watch, with_teeth_of


@dataclass(frozen=True)
class Watched:
    """What a watch announced, and how many windows of the cut had which verdict."""

    announcements: tuple[Announcement, ...]
    windows: dict[str, int]


@step
def watch(
    session: Annotated[File, Reads("SESSION.toml")],
    /,
    *,
    cutting: Annotated[File | None, Reads("CUT.toml")] = None,
    teeth: Annotated[int | None, Typed("N"), Ge(1), Le(100)] = None,
    speed: Annotated[float, Typed("RPM")] | None = None,
    responses: Names = (),
    model: ModelGiven | None = None,
    stream: str | None = None,
    out: Annotated[File | None, Writes("REC.h5", suffixes=(".h5", ".hdf5"))] = None,
    mqtt: Annotated[str | None, Typed("HOST:PORT")] = None,
    topic: str = "millfrf/chatter",
) -> Watched:
    """Announce chatter while a session runs, about half a second after its onset; propose speeds.

    Every 0.1 s the last 0.4 s or 42 revolutions of the spindle, whichever is longer, are judged like a recording by
    `millfrf chatter`. Chatter, an open verdict and the return to a stable cut are printed, marked in the recording, and
    sent to the cell. Nothing is moved: a person or the cell's own controller decides.

    Parameters
    ----------
    session
        Session file: what is wired where, and for how long.
    cutting
        Cutting file: teeth, feed and runout.
    teeth
        Number of cutting edges, instead of a cutting file; without either that of the session.
    speed : rpm
        Spindle speed; without it that of the session, or of the device that measures it.
    responses
        Channels to judge by; without it all that measure motion, or else force, or else anything.
    model
        Modal model of the structure: the line nearest to a mode is the chatter frequency.
    stream
        Sample clock; needed where the session has several.
    out
        Recording to write, with marks in the event series `chatter`.
    mqtt
        Broker to which each change is sent, as one JSON message.
    topic
        Topic of the messages.

    Returns
    -------
    Watched
        What was announced, and the number of windows of each verdict.

    Raises
    ------
    InputError
        The session has a mistake, teeth or speed are not known, or no broker answers.
    DeviceError
        A device cannot be set up, or fails; the file is closed with the samples before.
    MillfrfError
        The judgement failed; the recording is complete.

    Examples
    --------
    ::

        $ millfrf watch session.toml --teeth 4 --speed 6900 --out rec1.h5 --mqtt broker.local
    """
    opened = open_session(session)
    options, warnings = cut_options(
        cutting, with_teeth_of(opened.session, teeth), speed, names_of(responses), stream, model
    )
    announced: list[Announcement] = []
    listeners = [announced.append, _print]
    with ExitStack() as stack:
        if mqtt is not None:
            messages = CellMessages(mqtt, topic)
            stack.callback(messages.close)
            listeners.append(messages)
        warn(warnings)

        def announce(announcement: Announcement) -> None:
            for listener in listeners:
                listener(announcement)

        watching = chatter_watch(opened.session, opened.source, options, announce, waits=out is None)
        stack.callback(watching.close)
        if out is None:
            _run(opened, watching)
        else:
            with progress(f"recording {out}", opened.source.n_samples) as update:
                source = WithFeeds(opened.source, [watching])
                tally = record_session(replace(opened, source=source), out, watchers=[watching], progress=update)
            watching.finish()
            say(tally.summary())
    if watching.error is not None:
        raise MillfrfError(f"the cut was not judged to its end: {watching.error}") from watching.error
    if watching.n_skipped:
        warn([f"{counted(watching.n_skipped, 'block')} recorded but not judged: this computer is too slow"])
    if watching.announced_nothing:
        why = watching.open_reason or "it was shorter than five windows in a row"
        warn([f"no verdict on this cut: {why}"])
    watched = Watched(tuple(announced), dict(watching.counts))
    tell(lambda: {"announcements": [message_of(item) for item in announced], "windows": watched.windows})
    say(_summary(watched))
    if out is not None:
        say_written([out])
    return watched


def _print(announcement: Announcement) -> None:
    say(f"{announcement.time:9.2f} s  {announcement.in_words}")


def _summary(watched: Watched) -> str:
    parts: Sequence[str] = [f"{kind} {count}" for kind, count in sorted(watched.windows.items())]
    return f"windows judged: {', '.join(parts) or 'none'}"


def _run(opened: OpenedSession, watching: ChatterWatch) -> None:
    """Watch without a recording until the session's duration, its end or Ctrl-C."""
    duration = opened.session.duration_s
    source = opened.source
    with interrupts() as interrupted:
        try:
            source.open()
            while not interrupted() and (taken := source.read()) is not None:
                watching(taken)
                if duration and watching.seconds >= duration:
                    break
        finally:
            source.close()
    watching.finish()
