"""Tab of the files: drop files, see what each holds, and say what the channels of another program's file are."""

import html
from pathlib import Path
from typing import Any

import panel as pn
import panel_material_ui as pmui

from millfrf.core import InputError, counted
from millfrf.live.panel_server import said

from .command_lines import CommandLine
from .folder import FOREIGN, SETTINGS, FolderFile, description
from .forms import file_choice, offer_files
from .mapping_form import MappingForm
from .own_files import store_dropped
from .run_panel import RunPanel
from .workspace import Workspace

_WORDS = {FOREIGN: "say below what its channels are", SETTINGS: "a session, a mapping, a campaign or a robot"}
_CELL = "padding:3px 14px 3px 0;text-align:left;vertical-align:top"


def files_tab(workspace: Workspace) -> Any:
    """Build the tab of the files."""
    table = pn.pane.HTML("", sizing_mode="stretch_width")
    result = pn.pane.HTML("")
    drop = pmui.FileInput(label="Add files", multiple=True, width=420)
    again = pmui.Button(label="Look again", variant="outlined", on_click=lambda _: workspace.look())

    def show(files: tuple[FolderFile, ...]) -> None:
        table.object = _table(workspace.folder, files)

    def dropped(_: Any) -> None:
        if not drop.value:
            return
        names = drop.filename if isinstance(drop.filename, list) else [drop.filename]
        contents = drop.value if isinstance(drop.value, list) else [drop.value]
        try:
            for name, content in zip(names, contents, strict=True):
                store_dropped(workspace.folder, name, content)
            result.object = said(f"{counted(len(names), 'file')} added.")
        except (InputError, OSError) as error:
            result.object = said(str(error), "alert")
        workspace.look()

    drop.param.watch(dropped, "value")
    workspace.on_files(show)
    show(workspace.files)
    hint = "Files above 150 MB: copy them into the folder yourself, then look again."
    return pmui.Column(
        pmui.Row(drop, again),
        pmui.Typography(hint, variant="body2"),
        result,
        table,
        _foreign(workspace),
        sizing_mode="stretch_width",
    )


def _table(folder: Path, files: tuple[FolderFile, ...]) -> str:
    """Return the files as a table of HTML."""
    if not files:
        return "<p>No file that millfrf reads is here yet: add recordings, FRFs or models.</p>"
    heading = "".join(f'<th scope="col" style="{_CELL}">{name}</th>' for name in ("file", "kind", "content"))
    rows = []
    for file in files:
        words = _WORDS.get(file.kind) or description(folder / file.name)
        cells = "".join(f'<td style="{_CELL}">{html.escape(text)}</td>' for text in (file.kind, words))
        rows.append(f'<tr><th scope="row" style="{_CELL}">{html.escape(file.name)}</th>{cells}</tr>')
    body = "".join(rows)
    return f'<table style="border-collapse:collapse"><thead><tr>{heading}</tr></thead><tbody>{body}</tbody></table>'


def _foreign(workspace: Workspace) -> Any:
    """Choose a file of another program, say what its channels are, and convert it."""
    choice = file_choice("File of another program")
    place = pmui.Column(sizing_mode="stretch_width")

    def offer(files: tuple[FolderFile, ...]) -> None:
        offer_files(choice, [file.name for file in files if file.kind == FOREIGN])

    def chosen(_: Any) -> None:
        place.objects = [] if not choice.value else [_conversion(workspace, choice.value)]

    choice.param.watch(chosen, "value")
    workspace.on_files(offer)
    offer(workspace.files)
    heading = pmui.Typography("Recordings of other programs", variant="h2", sx={"fontSize": "1.2rem"})
    return pmui.Column(heading, choice, place, sizing_mode="stretch_width")


def _conversion(workspace: Workspace, name: str) -> Any:
    path = workspace.folder / name
    mapping, out = f"{path.stem}_map.toml", f"{path.stem}.h5"
    try:
        form = MappingForm(path)
    except InputError as error:
        return pmui.Typography(str(error))
    command = CommandLine(("convert", name, out, "--map", mapping))
    run = RunPanel(workspace, f"Convert {name}", lambda: command, lambda: form.write(workspace.folder / mapping))
    return pmui.Column(form.view, run.view, sizing_mode="stretch_width")
