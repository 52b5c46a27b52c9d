"""Store of results: a folder for each key, complete or absent; digest of the program."""

import hashlib
import json
from collections.abc import Callable
from contextlib import suppress
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from millfrf import PACKAGES
from millfrf.core import writing_whole_folder
from millfrf.core.provenance import versions

from .work import Outcome

RESULTS, OUTCOME, FORMAT = "results", "outcome.json", "millfrf.campaign_outcome"
_LENGTH = 24


def folder_of(out: Path, kind: str, key: str) -> Path:
    """Folder of a result; the first two letters of the key make folders of few entries."""
    return out / RESULTS / kind / key[:2] / key[:_LENGTH]


def read_outcome(out: Path, identity: str, key: str) -> Outcome | None:
    """What became of a task; None where it has not been run, or files of its result are missing."""
    folder = folder_of(out, identity.partition(":")[0], key)
    try:
        stored = json.loads((folder / OUTCOME).read_text(encoding="utf-8"))
        whole = stored["key"] == key and all((folder / name).stat().st_size == n for name, n in stored["files"].items())
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None
    if not whole:
        return None
    return Outcome(identity, stored["status"] == "done", folder, stored["reason"], tuple(stored["warnings"]))


def store_outcome(out: Path, identity: str, key: str, job: Callable[[Path], tuple[str, list[str]]]) -> Outcome:
    """Do a job in an unfinished folder and give it its place, with what became of it.

    Parameters
    ----------
    out
        Folder of results.
    identity, key
        Kind and name of the task, and the key of its result.
    job
        Function that writes its files into a folder and returns the reason of a refusal (empty: none) and doubts.
    """
    kind = identity.partition(":")[0]
    folder = folder_of(out, kind, key)
    try:
        with writing_whole_folder(folder) as unfinished:
            reason, warnings = job(unfinished)
            files = {path.relative_to(unfinished).as_posix(): path.stat().st_size for path in _files(unfinished)}
            content: dict[str, Any] = {
                "format": FORMAT,
                "kind": kind,
                "key": key,
                "status": "refused" if reason else "done",
                "reason": reason,
                "warnings": warnings,
                "files": files,
            }
            (unfinished / OUTCOME).write_text(json.dumps(content, indent=1), encoding="utf-8")
    except OSError:
        with suppress(OSError):
            found = read_outcome(out, identity, key)
            if found is not None:  # another worker, which was taken for dead, was faster
                return found
        raise
    return Outcome(identity, not reason, folder, reason, tuple(warnings))


def _files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob("*") if path.is_file())


def forget(out: Path, identity: str, key: str) -> None:
    """Take a result out of the store, so that its task is run again."""
    folder = folder_of(out, identity.partition(":")[0], key)
    with suppress(OSError):
        (folder / OUTCOME).unlink()


OPTIONAL = ("pandas", "pyarrow")
"""Libraries that some jobs refuse to do without: a refusal for their sake is forgotten when they are installed."""

_SUFFIXES = {".py", ".toml", ".j2", ".css", ".js", ".html"}

_ROOT = Path(__file__).resolve().parents[2]


@lru_cache(maxsize=1)
def program_digest() -> str:
    """SHA-256 over the files of the program and the versions of the libraries that compute."""
    digest = hashlib.sha256(json.dumps({**versions(), **_optional()}, sort_keys=True).encode())
    for room in (*PACKAGES, "millfrf"):
        files = [path for path in (_ROOT / room).rglob("*") if path.suffix in _SUFFIXES and path.is_file()]
        for path in sorted(files):
            digest.update(path.relative_to(_ROOT).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()


def _optional() -> dict[str, str]:
    found = {}
    for name in OPTIONAL:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "none"
    return found
