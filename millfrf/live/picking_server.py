"""Server of the page on which poles are picked, and the file of the chosen poles."""

import asyncio
import os
import webbrowser
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from estimation import Frf
from millfrf.core import MillfrfError, writing_whole_file
from millfrf.core.provenance import sources, versions
from millfrf.core.results import optional_library
from millfrf.core.terminal import say
from modal_fit import ModalFit

from .picking import PickSession, Pole


def write_picked(
    path: str | os.PathLike[str], chosen: Sequence[Pole], frf: str | os.PathLike[str], band: tuple[float, float]
) -> None:
    """Write chosen poles as TOML, with the FRF and the band (Hz) in comments."""
    [source] = sources([frf])
    lines = [
        f"# Poles picked in the browser from {_comment(str(source['file']))}, {band[0]:g} to {band[1]:g} Hz.",
        f"# SHA-256 of that file: {source['sha256']}; millfrf {versions()['millfrf']}.",
        f"# Repeat: millfrf fit {_comment(str(source['file']))} --band {band[0]:g} {band[1]:g} --poles THIS_FILE",
        'format = "millfrf.poles"',
        "format_version = 1",
    ]
    for frequency, damping in sorted(chosen):
        lines += ["", "[[poles]]", f"frequency_hz = {frequency!r}", f"damping_ratio = {damping!r}"]
    with writing_whole_file(path) as temporary:
        Path(temporary).write_text("\n".join(lines) + "\n", encoding="utf-8")


def _comment(text: str) -> str:
    """Replace characters that would end a comment line."""
    return "".join(letter if letter.isprintable() else "?" for letter in text)


def pick_poles(
    session: PickSession, say: Callable[[str], None], show: Callable[[str], object] | None = None
) -> list[Pole]:
    """Serve the page until a choice is saved, and return the choice.

    The server listens on this computer only and checks token, ``Host`` and ``Origin``, as the live page does.
    """
    chosen = asyncio.run(_served(session, say, show or webbrowser.open))
    if chosen is None:
        raise MillfrfError("no poles were saved on the page: nothing is written")
    return chosen


async def _served(session: PickSession, say: Callable[[str], None], show: Callable[[str], object]) -> list[Pole] | None:
    import panel as pn
    import panel_material_ui as pmui

    from .panel_server import serve_page
    from .picking_page import PickingPage

    ended: asyncio.Future[list[Pole] | None] = asyncio.get_running_loop().create_future()

    def end(poles: list[Pole] | None) -> None:
        if not ended.done():
            ended.set_result(poles)

    def page() -> Any:
        pn.extension(notifications=False)
        heading = pmui.Typography(f"Pick poles: {session.name}", variant="h1", sx={"fontSize": "1.6rem"})
        return pmui.Container(heading, PickingPage(session, end).view, width_option="lg")

    def announce(url: str) -> None:
        say(f"pick poles at {url}")
        show(url)

    answer: list[Pole] | None = await serve_page(page, f"Pick poles: {session.name}", announce, ended)
    return answer


def pick_in_browser(
    pick: str | os.PathLike[str], path: Path, frf: Frf, automatic: ModalFit, max_order: int | None = None
) -> Path:
    """Show an automatic fit on a page until poles are saved, and write them."""
    optional_library("panel", "fit --pick", "app")
    session = PickSession(path.name, frf, automatic, max_order)
    chosen = pick_poles(session, say)
    write_picked(pick, chosen, path, automatic.band)
    say(f"wrote {pick}: {len(chosen)} poles; --poles {pick} repeats the fit")
    return Path(pick)
