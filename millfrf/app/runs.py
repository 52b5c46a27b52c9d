"""Commands of the page, each in a process of its own: the page answers meanwhile, and a run can be stopped."""

import asyncio
import os
import re
import signal
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from millfrf.core.progress import AS_LINES

from .command_lines import CommandLine

_PROGRESS = re.compile(r"^progress: (?P<what>.*?) (?P<done>\d+)/(?P<total>\d+)$")


@dataclass
class Run:
    """A command that runs, or has run.

    Parameters
    ----------
    command
        The command.
    folder
        Its working folder.
    tell
        Called with the run whenever a line or progress comes.
    """

    command: CommandLine
    folder: Path
    tell: Callable[["Run"], None]
    lines: list[str] = field(default_factory=list)
    stage: str = ""  # what is being done
    share: float | None = None  # of the stage that is done; None: unknown
    exit_code: int | None = None
    _process: asyncio.subprocess.Process | None = None

    async def run(self) -> int:
        """Run the command to its end, and return its exit code."""
        self._process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", "millfrf", *self.command.words),
            cwd=self.folder,
            env={**os.environ, AS_LINES: "1", "COLUMNS": "110", "PYTHONUNBUFFERED": "1"},
            stdin=asyncio.subprocess.DEVNULL,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.STDOUT,
            limit=1 << 24,  # bytes of a line
        )
        assert self._process.stdout is not None
        async for line in self._process.stdout:
            self._take(line.decode("utf-8", "replace").rstrip())
        self.exit_code = await self._process.wait()
        self.tell(self)
        return self.exit_code

    def _take(self, line: str) -> None:
        progress = _PROGRESS.match(line)
        if progress is None:
            self.lines.append(line)
        else:
            self.stage, total = progress["what"], int(progress["total"])
            self.share = int(progress["done"]) / total if total else None
        self.tell(self)

    def stop(self) -> None:
        """Stop the command as Ctrl-C does: unfinished files are removed."""
        if self._process is not None and self._process.returncode is None:
            self._process.send_signal(signal.SIGINT if os.name == "posix" else signal.SIGTERM)
