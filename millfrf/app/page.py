"""The page: a tab for each part of the way from files to a cut."""

from typing import Any

import panel as pn
import panel_material_ui as pmui

from millfrf.commands import STEPS
from millfrf.core import InputError
from millfrf.live.panel_server import said

from .cut_tab import cut_tab
from .files_tab import files_tab
from .modes_tab import modes_tab
from .saved_work import write_work
from .step_panel import StepPanel
from .views import preformatted
from .workspace import Workspace

SAVED = "work.toml"
"""File of the session."""

HIDDEN = ("app", "repeat", "demo")
"""Commands without a form."""


def page_of(workspace: Workspace) -> Any:
    """Build the page for a visitor."""
    pn.extension(notifications=False)
    visit = workspace.visited()
    tabs = pmui.Tabs(
        ("1 Files", files_tab(visit)),
        ("2 FRF", _frf_tab(visit)),
        ("3 Modes", modes_tab(visit)),
        ("4 Cut", cut_tab(visit)),
        ("5 Sheet", _sheet_tab(visit)),
        ("Recorded cuts", _cuts_tab(visit)),
        ("Diagnosis", _diagnosis_tab(visit)),
        ("Record", _record_tab(visit)),
        ("Other steps", _others_tab(visit)),
        sizing_mode="stretch_width",
    )
    return pmui.Container(
        pmui.Typography("millfrf: from recordings to a cut that holds", variant="h1", sx={"fontSize": "1.6rem"}),
        pmui.Typography(f"Folder: {workspace.folder}", variant="body2"),
        tabs,
        _session_of(visit),
        width_option="lg",
    )


def _frf_tab(visit: Workspace) -> Any:
    shown = ("band", "responses", "out")
    panels = {
        "From taps of a hammer": StepPanel(visit, "tap", ("point", *shown), {"out": "frf_taps.h5"}).view,
        "From milling": StepPanel(visit, "estimate", shown, {"out": "frf_milling.h5"}).view,
        "From files of another program": StepPanel(visit, "convert", (), {"out": "frf.h5"}).view,
    }
    return pmui.Tabs(*panels.items(), sizing_mode="stretch_width")


def _sheet_tab(visit: Workspace) -> Any:
    proposed = {"out": "report.html", "sheet": "sheet.png"}
    panel = StepPanel(visit, "report", ("title", "out", "sheet"), proposed)

    def tick() -> None:
        """Tick the files of the session, of which the sheet then tells."""
        files = panel.form.fields["files"]
        named = {word for command in visit.commands for word in command.words if command.name != "report"}
        files.value = [name for name in files.options if name in named or name in files.value]

    visit.on_commands(tick)
    return panel.view


def _cuts_tab(visit: Workspace) -> Any:
    panels = {
        "Does it chatter?": StepPanel(visit, "chatter", ("cutting", "speed", "out")).view,
        "Force coefficients": StepPanel(visit, "cut identify", ("depth", "feeds", "speed", "out")).view,
        "Learn from cuts": StepPanel(visit, "learn", ("cutting", "out"), {"out": "model_learned.json"}).view,
    }
    return pmui.Tabs(*panels.items(), sizing_mode="stretch_width")


def _diagnosis_tab(visit: Workspace) -> Any:
    return StepPanel(visit, "diagnose", ("band", "out"), {"out": "diagnosis"}).view


def _record_tab(visit: Workspace) -> Any:
    panels = {
        "Record": StepPanel(visit, "acquire", ("out", "live"), {"out": "recording.h5"}).view,
        "Describe the rig": StepPanel(visit, "new session", (), {"out": "session.toml"}).view,
        "Watch for chatter": StepPanel(visit, "watch", ()).view,
    }
    return pmui.Tabs(*panels.items(), sizing_mode="stretch_width")


def _others_tab(visit: Workspace) -> Any:
    names = [name for name in STEPS if name not in HIDDEN]
    choice = pn.widgets.Select(label="Step", options=names, value="inspect", width=420)
    place = pmui.Column(StepPanel(visit, "inspect").view, sizing_mode="stretch_width")
    choice.param.watch(lambda event: setattr(place, "objects", [StepPanel(visit, event.new).view]), "value")
    return pmui.Column(choice, place, sizing_mode="stretch_width")


def _session_of(visit: Workspace) -> Any:
    """Show the commands so far, and save them."""
    listed, result = pn.pane.HTML("", sizing_mode="stretch_width", max_width=1000), pn.pane.HTML("")

    def show() -> None:
        text = "\n".join(command.text for command in visit.commands) or "No step was run yet."
        listed.object = preformatted(text, "Commands of this session", 200)

    def save(_: Any) -> None:
        try:
            write_work(visit.folder / SAVED, visit.commands)
        except InputError as error:
            result.object = said(str(error), "alert")
            return
        result.object = said(f"Saved; in this folder, millfrf repeat {SAVED} runs these commands again.")

    button = pmui.Button(label="Save the session", variant="outlined", on_click=save, disabled=True)

    def changed() -> None:
        show()
        button.disabled = not visit.commands

    visit.on_commands(changed)
    changed()
    heading = pmui.Typography("Session", variant="h2", sx={"fontSize": "1.2rem", "marginTop": "24px"})
    return pmui.Column(heading, listed, button, result, sizing_mode="stretch_width")
