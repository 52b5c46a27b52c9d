"""Folder and session of the page: the files that are there, and the commands that were run."""

from collections.abc import Callable
from pathlib import Path

from .command_lines import CommandLine
from .folder import FolderFile, files_in

RECORDING = ("acquire", "watch")
"""Commands whose outputs cannot be made again."""


class Workspace:
    """Files of a folder, and the commands of a session in their order.

    Parameters
    ----------
    folder
        Folder in which commands run.
    commands
        Commands so far; several visitors of one page share them.
    """

    def __init__(self, folder: Path, commands: list[CommandLine] | None = None) -> None:
        self.folder = folder
        self.files = files_in(folder)
        self._commands: list[CommandLine] = [] if commands is None else commands
        self._on_files: list[Callable[[tuple[FolderFile, ...]], None]] = []
        self._on_commands: list[Callable[[], None]] = []

    def visited(self) -> "Workspace":
        """Return the workspace of a further visitor, with the same commands."""
        return Workspace(self.folder, self._commands)

    @property
    def commands(self) -> tuple[CommandLine, ...]:
        """Commands that succeeded; one that was run again stands once, at its last place."""
        return tuple(self._commands)

    def on_files(self, called: Callable[[tuple[FolderFile, ...]], None]) -> None:
        """Call a function when files came or went."""
        self._on_files.append(called)

    def on_commands(self, called: Callable[[], None]) -> None:
        """Call a function when a command was added."""
        self._on_commands.append(called)

    def add(self, command: CommandLine) -> None:
        """Add a command that succeeded, but none that records: a session that is repeated replaces its outputs."""
        if command.name in RECORDING:
            return
        if command.repeatable in self._commands:
            self._commands.remove(command.repeatable)
        self._commands.append(command.repeatable)
        for called in self._on_commands:
            called()

    def look(self) -> None:
        """Look at the folder again."""
        files = files_in(self.folder)
        if files != self.files:
            self.files = files
            for called in self._on_files:
                called(files)
