"""`millfrf acquire`: record a session, or check it before the cut."""

from pathlib import Path
from typing import Annotated

import typer

from millfrf.core.terminal import say


def acquire(
    session: Annotated[Path, typer.Argument(metavar="SESSION.toml", help="What is wired where, and for how long.")],
    out: Annotated[Path | None, typer.Option("--out", metavar="REC.h5", help="Recording to write.")] = None,
    check: Annotated[
        bool, typer.Option("--check", help="Listen, judge every channel and record nothing; tap to check signs.")
    ] = False,
    seconds: Annotated[float, typer.Option("--seconds", min=0.1, help="How long --check listens, s.")] = 3.0,
    live: Annotated[
        bool, typer.Option("--live", help="Show the signals on a page; its Start button begins the recording.")
    ] = False,
    live_address: Annotated[
        str, typer.Option("--live-address", metavar="IP", help="Where the page listens; else on this machine only.")
    ] = "127.0.0.1",
    live_port: Annotated[int, typer.Option("--live-port", min=0, max=65535, help="0: any free port.")] = 0,
    at_once: Annotated[bool, typer.Option("--at-once", help="With --live: record without waiting for Start.")] = False,
    force: bool = False,
) -> None:
    """Record from the devices of a session until its duration is over, Stop is pressed or Ctrl-C."""
    from millfrf.core import InputError
    from millfrf.steps.acquire import open_session

    from ..options import check_output

    if (out is None) == (not check):
        raise InputError("give either --out REC.h5 to record or --check to look at the signals first")
    if out is not None:
        check_output(out, (".h5", ".hdf5"))
    opened = open_session(session)
    for stream in opened.source.streams:
        say(f"stream {stream.name}: {len(stream.channels)} channels at {stream.sample_rate:.9g} Hz")
    for notice in getattr(opened.source, "notices", ()):
        say(f"note: {notice}")
    if out is None:
        _check(opened.source, seconds)
    elif live:
        from millfrf.steps.acquire import acquire_live

        tally = acquire_live(
            opened, out, address=live_address, port=live_port, at_once=at_once, overwrite=force, say=say
        )
        _report(tally, out)
    else:
        _record(opened, out, force)


def _check(source: object, seconds: float) -> None:
    from acquisition import Source
    from millfrf.core import MillfrfError
    from millfrf.core.terminal import show
    from millfrf.steps.signal_check import listen, preflight

    assert isinstance(source, Source)
    heard = listen(source, seconds)
    found = preflight(heard.streams, heard.doubts)
    show(found.table())
    for tap in found.taps:
        say(f"tap: {tap.acceleration.name} {1e6 * tap.delay:+.0f} us after {tap.force.name}")
    concerns = found.concerns()
    for line in concerns:
        say(f"concern: {line}")
    if concerns:
        raise MillfrfError(f"pre-flight: {len(concerns)} concerns about {len(found.checks)} channels; see above")
    say("pre-flight: nothing wrong")


def _record(opened: object, out: Path, overwrite: bool) -> None:
    from millfrf.core.progress import bar
    from millfrf.steps.acquire import OpenedSession, acquire

    assert isinstance(opened, OpenedSession)
    with bar(f"recording {out.name}", opened.source.n_samples) as update:
        tally = acquire(opened, out, progress=update, overwrite=overwrite)
    _report(tally, out)


def _report(tally: object, out: Path) -> None:
    from millfrf.gate import doubts_of_rate
    from millfrf.steps.acquire import Tally

    if not isinstance(tally, Tally):
        say("stopped before Start; nothing was recorded")
        return
    say(tally.summary())
    story = tally.device_story()
    for line in (*story.losses, *story.notices):
        say(f"device: {line}")
    say(f"wrote {out}")
    for doubt in doubts_of_rate(out):
        say(f"warning: {doubt}")
