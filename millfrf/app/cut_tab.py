"""Tab of the cut: sliders for cutter and coefficients, lobes that follow them, and the table of limits."""

import asyncio
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import panel as pn
import panel_material_ui as pmui

from millfrf.core import InputError, MillfrfError
from millfrf.core.terminal import grouped, silently
from millfrf.figures import limits_panels
from millfrf.live.panel_server import said
from millfrf.stability import StabilityLobes
from millfrf.steps.lobes import default_speeds, lobes, lobes_summary
from modal_fit import ModalModel, read_modal_model

from .command_lines import CommandLine
from .cut_fields import CutFields
from .folder import FolderFile, files_for
from .forms import file_choice, offer_files
from .run_panel import RunPanel
from .workspace import Workspace

N_SPEEDS = 80
"""Speeds of the curve that follows the sliders."""


class CutTab:
    """Model, cut, and the limits of both."""

    def __init__(self, workspace: Workspace) -> None:
        self._workspace = workspace
        self.model = file_choice("Model of the tip")
        self.base = file_choice("Begin with the cut of")
        self.speeds = pmui.TextInput(
            label="Speeds: lowest highest (rpm)", placeholder="found from the modes", width=420
        )
        self.depth = pmui.FloatSlider(
            label="Largest depth searched (mm)", start=0.1, end=30, step=0.1, value=5, width=420
        )
        self.name = pmui.TextInput(label="Save the cut as", value="cut_page.toml", width=420)
        self.table = pmui.TextInput(label="Save the limits as", value="lobes.csv", width=420)
        self.cut = CutFields()
        self.replace = pmui.Checkbox(label="Replace a table of limits that is there", value=False)
        self._plot = pn.pane.Bokeh(None, sizing_mode="stretch_width", min_width=420)
        self._said = pn.pane.HTML("", sizing_mode="stretch_width")
        self._asked = 0
        self.run = RunPanel(workspace, "Save the cut and compute limits", self.command, self._save)
        for field in (self.name, self.table, self.replace):
            field.param.watch(lambda _: self.run.show_code(), "value")
        for field in (self.model, self.speeds, self.depth, *self.cut.fields):
            field.param.watch(self._changed, "value")
        self.base.param.watch(self._begin, "value")
        workspace.on_files(self._offer)
        self._offer(workspace.files)

    @property
    def view(self) -> Any:
        """Sliders at the left, lobes at the right."""
        files = (self.name, self.table)
        of_cut = self.cut.fields
        fields = pmui.Column(self.model, self.base, *of_cut, self.speeds, self.depth, *files, width=450)
        drawn = pmui.Column(self._plot, self._said, self.replace, self.run.view, sizing_mode="stretch_width")
        return pmui.FlexBox(fields, drawn, sizing_mode="stretch_width", align_items="flex-start")

    def _offer(self, files: tuple[FolderFile, ...]) -> None:
        for field, placeholder in ((self.model, "MODEL.json"), (self.base, "CUT.toml")):
            offer_files(field, files_for(files, placeholder))

    def _begin(self, _: Any) -> None:
        try:
            if self.base.value:
                self.cut.read(self._workspace.folder / self.base.value)
            else:
                self.cut.reset()
        except MillfrfError as error:
            self._say(str(error), "alert")

    async def _changed(self, _: Any) -> None:
        """Compute the lobes of the sliders; of several changes only the last one is drawn."""
        self.run.show_code()
        self._asked += 1
        asked = self._asked
        self._plot.object = None  # the limits of other values of the fields
        self._say("")
        await asyncio.sleep(0.15)  # until a slider rests
        if asked != self._asked or not self.model.value:
            return
        self._say("computing the limits …")
        try:
            limits = await asyncio.to_thread(self._limits)
        except MillfrfError as error:
            self._say(str(error), "alert")
            return
        if asked == self._asked:
            self._draw(limits)

    def _limits(self) -> StabilityLobes:
        structure = read_modal_model(self._workspace.folder / self.model.value)
        low, high = self._range(structure)
        with silently():
            return lobes(structure, self.cut.process, speeds=(low, high, N_SPEEDS), max_depth=1e-3 * self.depth.value)

    def _range(self, structure: ModalModel) -> tuple[float, float]:
        words = self.speeds.value.replace(",", " ").split()
        if not words:
            return default_speeds(structure, self.cut.process)[:2]
        try:
            low, high = map(float, words)
        except ValueError as error:
            raise InputError(f"speeds {self.speeds.value!r}: give two numbers in rpm, such as 3000 12000") from error
        return low, high

    def _draw(self, limits: StabilityLobes) -> None:
        self._plot.object = limits_panels({"limit": limits})
        self._say(lobes_summary(limits, 1e-3 * self.depth.value), more=grouped(limits.warnings))

    def command(self) -> CommandLine:
        """Return the command that computes the table of limits."""
        if not self.model.value:
            raise InputError("choose a model of the tip")
        words = self.speeds.value.replace(",", " ").split()
        options = [*(("--speeds", *words, "200") if words else ()), "--max-depth", f"{1e-3 * self.depth.value:.6g}"]
        forced = ["--force"] if self.replace.value else []
        files = ("--cutting", self._cut_name, "--out", self.table.value, *forced)
        return CommandLine(("lobes", self.model.value, *options, *files))

    @property
    def _cut_name(self) -> str:
        """Name of the cutting file, which stands in the folder itself."""
        name = str(self.name.value or "").strip()
        if Path(name).name != name or Path(name).suffix != ".toml":
            raise InputError(f"save the cut as {name!r}: give a name in this folder that ends with .toml")
        return name

    def _save(self) -> None:
        self.cut.write(self._workspace.folder / self._cut_name)

    def _say(self, text: str, role: str = "status", more: Sequence[str] = ()) -> None:
        self._said.object = said(text, role, more)


def cut_tab(workspace: Workspace) -> Any:
    """Build the tab of the cut."""
    return CutTab(workspace).view
