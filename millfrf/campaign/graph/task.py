"""`Task`: one piece of work of a campaign."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Task:
    """One piece of work: what is done, with which files, after which other tasks.

    Parameters
    ----------
    kind
        Kind of the work, such as ``spectra`` or ``fit``.
    name
        Name of what it is done with; unlike that of every other task of the kind.
    files
        Paths of the files that it reads, besides results of other tasks.
    needs
        Identities of the tasks whose results it reads.
    settings
        Settings as JSON knows them: numbers, text, lists, tables.
    """

    kind: str
    name: str
    files: tuple[str, ...] = ()
    needs: tuple[str, ...] = ()
    settings: Mapping[str, Any] = field(default_factory=dict)

    @property
    def identity(self) -> str:
        """Kind and name, such as ``fit:P07``."""
        return f"{self.kind}:{self.name}"
