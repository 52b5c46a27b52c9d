"""Step ``app``: a page to work on, served to this computer."""

import asyncio
import sys
import webbrowser
from pathlib import Path
from typing import Annotated

from annotated_types import Ge, Le

from millfrf.core import InputError
from millfrf.core.results import optional_library
from millfrf.core.steps import File, Reads, step
from millfrf.core.terminal import say


@step
def app(
    folder: Annotated[File, Reads("FOLDER")] = ".",
    /,
    *,
    port: Annotated[int, Ge(0), Le(65535)] = 0,
    no_browser: bool = False,
) -> None:
    """Open a page to work on: from files to FRF, modes, limits and a sheet; each step shows its command and Python.

    The page is served to this computer alone, under an address with a token. Commands run in the folder, each in a
    process of its own. A session is saved as `work.toml`; `millfrf repeat work.toml` runs it again. Ctrl-C ends it.

    Parameters
    ----------
    folder
        Folder of the files.
    port
        Port of the page; 0 is any free port.
    no_browser
        Print the address only, and open no browser.

    Raises
    ------
    InputError
        No such folder, a port that is taken, or the libraries of the page are not installed.

    Examples
    --------
    ::

        $ millfrf app measurements
    """
    place = Path(folder)
    if not place.is_dir():
        raise InputError(f"{place} is no folder; give the folder of your files")
    optional_library("panel", "millfrf app", "app")

    from millfrf.live.panel_server import serve_page

    from .page import page_of
    from .workspace import Workspace

    workspace = Workspace(place.resolve())

    def show(url: str) -> None:
        say(f"the page is at {url} ; Ctrl-C ends it")
        sys.stdout.flush()  # another program may wait for the address
        if not no_browser:
            webbrowser.open(url)

    async def serve() -> None:
        ended: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        await serve_page(lambda: page_of(workspace), "millfrf", show, ended, port)

    asyncio.run(serve())
