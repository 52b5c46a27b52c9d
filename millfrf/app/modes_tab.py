"""Tab of the modes: the fit, and poles picked on the stabilisation chart."""

import asyncio
from typing import Any, cast

import panel as pn
import panel_material_ui as pmui

from estimation import read_frf
from millfrf.core import InputError, MillfrfError
from millfrf.core.terminal import silently
from millfrf.gate import FileKind, kind_of
from millfrf.live.panel_server import said
from millfrf.live.picking import PickSession, Pole
from millfrf.live.picking_page import PickingPage
from millfrf.live.picking_server import write_picked
from millfrf.steps.fit import fit
from modal_fit import ModalFit

from .own_files import replacing_own
from .step_panel import StepPanel
from .workspace import Workspace

POLES = "poles.toml"
"""File of the picked poles."""


class ModesTab:
    """Fit of an FRF or of recordings, and a choice of its poles by hand."""

    def __init__(self, workspace: Workspace) -> None:
        self._workspace = workspace
        self.panel = StepPanel(workspace, "fit", ("band", "modes", "poles", "out"), {"out": "model.json"})
        self._place = pmui.Column(sizing_mode="stretch_width")
        self._said = pn.pane.HTML("", sizing_mode="stretch_width")
        self._pick = pmui.Button(label="Pick poles on the chart", variant="outlined", on_click=self._clicked)

    @property
    def view(self) -> Any:
        """The step, and the chart below it."""
        return pmui.Column(self.panel.view, self._pick, self._said, self._place, sizing_mode="stretch_width")

    async def _clicked(self, _: Any) -> None:
        """Fit without picked poles, and show the chart of that fit."""
        self._say("fitting …")
        try:
            session = await asyncio.to_thread(self._session)
        except MillfrfError as error:
            self._say(str(error), "alert")
            return
        self._say("")
        page = PickingPage(session, lambda poles: self._ended(session, poles))
        self._place.objects = [page.view]

    def _session(self) -> PickSession:
        fields = self.panel.form.fields
        names = fields["sources"].value
        if len(names) != 1:
            raise InputError("poles are picked on the FRF of one file; choose one FRF under Sources")
        path = self._workspace.folder / names[0]
        if kind_of(path) != FileKind.FRF:
            raise InputError(f"{path.name} is no FRF; estimate one first, or fit the recording without picking")
        words = str(fields["band"].value or "").replace(",", " ").split()
        try:
            band = (float(words[0]), float(words[1])) if words else None
        except (ValueError, IndexError) as error:
            raise InputError(f"band {fields['band'].value!r}: give two frequencies in Hz, such as 10 120") from error
        with silently():
            automatic = cast(ModalFit, fit(path, band=band))
        return PickSession(path.name, read_frf(path), automatic)

    def _ended(self, session: PickSession, poles: list[Pole] | None) -> None:
        self._place.objects = []
        if poles is None:
            self._say("Nothing was saved.")
            return
        file = self._workspace.folder / POLES
        try:
            with replacing_own(file):
                write_picked(file, poles, self._workspace.folder / session.name, session.band)
        except InputError as error:
            self._say(str(error), "alert")
            return
        low, high = session.band
        self._workspace.look()
        self.panel.form.fill({"poles": POLES, "modes": "", "band": f"{low:g} {high:g}"})
        self._say(f"{len(poles)} poles are saved in {POLES}; run the fit to use them.")

    def _say(self, text: str, role: str = "status") -> None:
        self._said.object = said(text, role)


def modes_tab(workspace: Workspace) -> Any:
    """Build the tab of the modes."""
    return ModesTab(workspace).view
