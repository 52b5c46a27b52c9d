"""Server of the page on which poles are picked, and the file of the chosen poles."""

import asyncio
import json
import os
import webbrowser
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from estimation import Frf
from millfrf.core import InputError, MillfrfError, writing_whole_file
from millfrf.core.provenance import sources, versions
from millfrf.core.terminal import say
from modal_fit import ModalFit

from .guard import LOOPBACK, CountedServer, Guard, Limits, hosts_of
from .handlers import Guarded, Missing
from .picking import PickSession, Pole, checked_choice, drawn_page, fitted_answer


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


_FOLDER = Path(__file__).parent
_KINDS = {".js": "text/javascript", ".css": "text/css", ".json": "application/json"}


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
    from tornado.netutil import bind_sockets
    from tornado.web import Application

    [socket] = bind_sockets(0, LOOPBACK)
    port = socket.getsockname()[1]
    guard = Guard(hosts_of(LOOPBACK, port, True))
    ended: asyncio.Future[list[Pole] | None] = asyncio.get_running_loop().create_future()
    application = Application(
        [
            (r"/(?P<token>[^/]*)/(?P<name>fit|save|leave)", _handler("Answer")),
            (r"/(?P<token>[^/]*)/(?P<name>[^/]*)", _handler("File")),
        ],
        default_handler_class=Missing,
        log_function=lambda _: None,  # a request's path holds the token
        guard=guard,
        content=_content(session),
        session=session,
        ended=ended,
    )
    server = CountedServer.with_limits(application, Limits())
    server.add_sockets([socket])
    url = f"http://{LOOPBACK}:{port}/{guard.token}/"
    say(f"pick poles at {url}")
    show(url)
    try:
        return await ended
    finally:
        await asyncio.sleep(0.2)  # time for the answer to the last request
        server.stop()
        await server.close_all_connections()


def _content(session: PickSession) -> dict[str, tuple[bytes, str]]:
    from millfrf.figures import browser_library

    static = {name: (_FOLDER / name).read_bytes() for name in ("picking.js", "picking.css")}
    generated = {"page.json": drawn_page(session).encode(), "bokeh.min.js": browser_library().encode()}
    files = {name: (body, _KINDS[Path(name).suffix]) for name, body in (static | generated).items()}
    return files | {"": ((_FOLDER / "picking.html").read_bytes(), "text/html; charset=utf-8")}


def _handler(kind: str) -> Any:
    """Create the handlers; tornado is imported late, because the command line starts faster without it."""
    from tornado.web import HTTPError

    class File(Guarded):
        """Handler of the files of the page."""

        def get(self, token: str, name: str) -> None:
            del token
            if name not in self.application.settings["content"]:
                raise HTTPError(404)
            body, of_kind = self.application.settings["content"][name]
            self.set_header("Content-Type", of_kind)
            self.write(body)

    class Answer(Guarded):
        """Handler of requests: fit a choice, save it, or leave the page."""

        def prepare(self) -> None:
            super().prepare()
            if not self._guard.origin_is_ours(self.request.headers.get_list("Origin")):
                raise HTTPError(403)

        async def post(self, token: str, name: str) -> None:
            del token
            settings = self.application.settings
            try:
                asked = json.loads(self.request.body or b"{}")
            except (ValueError, RecursionError) as error:
                raise HTTPError(400) from error
            if name == "fit":
                loop = asyncio.get_running_loop()
                self.write(await loop.run_in_executor(None, fitted_answer, settings["session"], asked))
                return
            self.write(_ended(settings["session"], settings["ended"], asked if name == "save" else None))

    return {"File": File, "Answer": Answer}[kind]


def _ended(session: PickSession, ended: "asyncio.Future[list[Pole] | None]", request: object) -> dict[str, str]:
    """End the picking with a valid choice or without a choice; return the answer to the page."""
    chosen: list[Pole] | None = None
    if request is not None:
        answer = fitted_answer(session, request)
        if "error" in answer:
            return {"error": str(answer["error"])}
        try:
            chosen = checked_choice(request, 10**9)[0]
        except InputError as error:
            return {"error": str(error)}
    if not ended.done():
        ended.set_result(chosen)
    return {"done": "saved" if chosen else "left"}


def pick_in_browser(
    pick: str | os.PathLike[str], path: Path, frf: Frf, automatic: ModalFit, max_order: int | None = None
) -> Path:
    """Show an automatic fit on a page until poles are saved, and write them."""
    session = PickSession(path.name, frf, automatic, max_order)
    chosen = pick_poles(session, say)
    write_picked(pick, chosen, path, automatic.band)
    say(f"wrote {pick}: {len(chosen)} poles; --poles {pick} repeats the fit")
    return Path(pick)
