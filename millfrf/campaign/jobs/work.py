"""`Work`: what a job gets; and `Outcome`, what became of a task that it needs."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from millfrf.core import InputError


@dataclass(frozen=True)
class Outcome:
    """What became of a task.

    Parameters
    ----------
    identity
        Kind and name of the task.
    done
        Whether it was done; else it was refused.
    folder
        Folder of its result.
    reason
        Why it was refused, in one line; empty where it was done.
    warnings
        Doubts about its result.
    """

    identity: str
    done: bool
    folder: Path
    reason: str = ""
    warnings: tuple[str, ...] = ()

    @property
    def kind(self) -> str:
        """Kind of the task."""
        return self.identity.partition(":")[0]

    @property
    def name(self) -> str:
        """Name of what was done, without the kind."""
        return self.identity.partition(":")[2]


@dataclass(frozen=True)
class Work:
    """What a job works on.

    Parameters
    ----------
    files
        Paths of its files.
    digests
        SHA-256 of each.
    needs
        Outcomes of the tasks that it needs.
    settings
        Settings of the task.
    """

    files: tuple[Path, ...]
    digests: tuple[str, ...]
    needs: tuple[Outcome, ...]
    settings: Mapping[str, Any]

    def need(self, kind: str) -> Outcome:
        """The only outcome of that kind, which must have been done.

        Raises
        ------
        InputError
            It was refused; the line says why.
        """
        (found,) = (one for one in self.needs if one.kind == kind)
        if not found.done:
            raise InputError(f"no {kind}: {found.reason}")
        return found


def as_options(stored: Mapping[str, Any]) -> dict[str, Any]:
    """Options as a dataclass takes them: lists, which JSON makes of tuples, are tuples again."""
    return {name: tuple(value) if isinstance(value, list) else value for name, value in stored.items()}
