"""A step on the page: its form, and the run of the command that the form states."""

import html
from collections.abc import Mapping, Sequence
from typing import Any

import panel as pn
import panel_material_ui as pmui

from millfrf.command_line import without_markup

from .folder import FolderFile
from .forms import StepForm
from .run_panel import RunPanel
from .workspace import Workspace


class StepPanel:
    """Form and run of one step.

    Parameters
    ----------
    workspace
        Folder and session of the page.
    name
        Words of the command.
    shown
        Options that stand open; without it all.
    proposed
        Texts with which fields begin.
    """

    def __init__(
        self,
        workspace: Workspace,
        name: str,
        shown: Sequence[str] = (),
        proposed: Mapping[str, str] | None = None,
    ) -> None:
        self.form = StepForm(name, shown, proposed)
        self.form.offer(workspace.files)
        self.run = RunPanel(workspace, f"Run {name}", self.form.command)
        self.form.watch(self.run.show_code)
        workspace.on_files(self._offer)

    @property
    def view(self) -> Any:
        """The step as a column."""
        summary = pn.pane.HTML(f"<p>{html.escape(without_markup(self.form.summary))}</p>", sizing_mode="stretch_width")
        return pmui.Column(summary, self.form.view, self.run.view, sizing_mode="stretch_width")

    def _offer(self, files: tuple[FolderFile, ...]) -> None:
        self.form.offer(files)
        self.run.show_code()
