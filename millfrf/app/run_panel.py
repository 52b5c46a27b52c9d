"""A command on the page: what it is in a terminal and in Python, its progress, its output, and what it wrote."""

import asyncio
import html
import re
from collections.abc import Callable
from typing import Any

import panel as pn
import panel_material_ui as pmui

from millfrf.core import MillfrfError
from millfrf.live.panel_server import said

from .command_lines import CommandLine
from .runs import Run
from .views import preformatted, view_of
from .workspace import Workspace

MOST_LINES = 400
"""Lines of a command's output that the page shows."""

_ADDRESS = re.compile(r"http://(?:127\.0\.0\.1|\[::1\]):\d+/[\w-]+/")
"""Address of a live page that a command serves."""

_ENDS = {0: "is done", 1: "failed", 2: "was refused: see below what it says"}


class RunPanel:
    """Run a command, show its progress and output, and what it wrote.

    Parameters
    ----------
    workspace
        Folder and session of the page.
    label
        Label of the button that runs it.
    command
        Returns the command as the fields of the page state it now.
    before
        Called before a run, for what the page writes itself, such as a cutting file.
    """

    def __init__(
        self,
        workspace: Workspace,
        label: str,
        command: Callable[[], CommandLine],
        before: Callable[[], None] | None = None,
    ) -> None:
        self._workspace, self._command, self._before = workspace, command, before
        self._run: Run | None = None
        texts = (pn.pane.HTML("", sizing_mode="stretch_width", max_width=1000) for _ in range(4))
        self._code, self._output, self._status, self._progress = texts
        self._results = pmui.Column(sizing_mode="stretch_width")
        self._go = pmui.Button(label=label, color="primary", variant="contained", on_click=self._clicked)
        self._stop = pmui.Button(label="Stop", color="error", variant="outlined", visible=False, on_click=self._stopped)
        self.show_code()

    @property
    def view(self) -> Any:
        """Button, progress, results, output and code as a column."""
        parts = (pmui.Row(self._go, self._stop), self._status, self._progress, self._results, self._output, self._code)
        return pmui.Column(*parts, sizing_mode="stretch_width")

    def show_code(self) -> None:
        """Show the command and its Python lines as the fields state them now."""
        command = None
        try:
            command = self._command()
            text = f"$ {command.text}\n\n{command.python}"
        except Exception as error:  # of the parser, or of a field that is empty
            text = " ".join(str(error).split())
        self._code.object = preformatted(text, "As a command, and in Python")
        if self._run is not None and self._run.exit_code is not None and self._run.command != command:
            self._say(f"Changed since this run: {self._run.command.text}")

    async def _clicked(self, _: Any) -> None:
        try:
            if self._before is not None:
                self._before()
            command = self._command()
        except MillfrfError as error:
            self._say(str(error), "alert")
            return
        await self._start(command)

    async def _start(self, command: CommandLine) -> None:
        self._run = Run(command, self._workspace.folder, self._show)
        self._results.objects, self._output.object = [], ""
        self._go.disabled, self._stop.visible = True, True
        self._say(f"{command.name} runs …")
        code = await self._run.run()
        self._stop.visible, self._progress.object = False, ""
        self._workspace.look()
        if code == 0:
            self._workspace.add(command)
            self._results.objects = await asyncio.to_thread(self._written, command)
        self._say(f"{command.name} {_ENDS.get(code, 'was stopped')}.", "status" if code == 0 else "alert")
        self._go.disabled = False

    def _written(self, command: CommandLine) -> list[Any]:
        paths = [self._workspace.folder / name for name in command.outputs]
        return [view_of(path) for path in paths if path.exists()]

    def _show(self, run: Run) -> None:
        if run.stage:
            value = "" if run.share is None else f' value="{round(100 * run.share)}"'
            bar = f'<progress max="100"{value} aria-label="Progress of {run.command.name}"></progress>'
            self._progress.object = f"{html.escape(run.stage)} {bar}"
        lines = run.lines[-MOST_LINES:]
        address = next((match[0] for line in reversed(lines) if (match := _ADDRESS.search(line))), None)
        if address is not None and run.exit_code is None:
            self._progress.object = f'<a href="{address}" target="_blank" rel="noopener">Open the live page</a>'
        self._output.object = preformatted("\n".join(lines), f"Output of {run.command.name}", 360)

    def _stopped(self, _: Any) -> None:
        if self._run is not None:
            self._run.stop()

    def _say(self, text: str, role: str = "status") -> None:
        self._status.object = said(text, role)
