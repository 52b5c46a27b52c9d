"""Store of results: one folder for each key, written atomically; digest of the program."""

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
from millfrf.core.provenance import sha256, versions
from millfrf.core.runtime import notice

from .work import Outcome

RESULTS, OUTCOME, FORMAT = "results", "outcome.json", "millfrf.campaign_outcome"
_LENGTH = 24  # hexadecimal digits of the key in names of folders; outcome.json holds the whole key


def folder_of(out: Path, kind: str, key: str) -> Path:
    """Return the folder of a result; subfolders by the first two digits keep each folder small."""
    return out / RESULTS / kind / key[:2] / key[:_LENGTH]


def read_outcome(out: Path, identity: str, key: str) -> Outcome | None:
    """Read the outcome of a task; None if it has not run, or if a file of its result is missing or damaged."""
    folder = folder_of(out, identity.partition(":")[0], key)
    try:
        stored = json.loads((folder / OUTCOME).read_text(encoding="utf-8"))
        outcome = Outcome(identity, stored["status"] == "done", folder, stored["reason"], tuple(stored["warnings"]))
        is_its_own = stored["key"] == key
        stated = stored.pop("sha256")
        damaged = [name for name, digest in stored["files"].items() if _digest(folder / name) != digest]
        damaged += [] if stated == _digest_of_text(stored) else [OUTCOME]
    except FileNotFoundError:
        return None
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        is_its_own, damaged = True, [OUTCOME]
    if damaged:
        notice(
            f"the stored result of {identity} is not used, as {', '.join(damaged)} changed after it was written; it is "
            "made anew where it is needed"
        )
    return outcome if is_its_own and not damaged else None


def _digest_of_text(content: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _digest(path: Path) -> str:
    stat = path.stat()
    return _digest_of(path, stat.st_size, stat.st_mtime_ns)


@lru_cache(maxsize=1 << 16)
def _digest_of(path: Path, size: int, changed: int) -> str:
    """Return the SHA-256 of a file; a run reads most outcomes several times."""
    del size, changed
    return sha256(path)


def store_outcome(out: Path, identity: str, key: str, job: Callable[[Path], tuple[str, list[str]]]) -> Outcome:
    """Run a job in a temporary folder, then move that folder into the store.

    ``job`` writes its files into a folder. It returns the reason of a refusal (empty: none) and warnings.
    """
    kind = identity.partition(":")[0]
    folder = folder_of(out, kind, key)
    try:
        with writing_whole_folder(folder) as unfinished:
            reason, warnings = job(unfinished)
            files = {path.relative_to(unfinished).as_posix(): sha256(path) for path in _files(unfinished)}
            content: dict[str, Any] = {
                "format": FORMAT,
                "kind": kind,
                "key": key,
                "status": "refused" if reason else "done",
                "reason": reason,
                "warnings": warnings,
                "files": files,
            }
            content["sha256"] = _digest_of_text(content)
            (unfinished / OUTCOME).write_text(json.dumps(content, indent=1), encoding="utf-8")
    except OSError:
        with suppress(OSError):
            outcome = read_outcome(out, identity, key)
            if outcome is not None:  # a worker that the scheduler believed dead stored it first
                return outcome
        raise
    return Outcome(identity, not reason, folder, reason, tuple(warnings))


def _files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob("*") if path.is_file())


def forget(out: Path, identity: str, key: str) -> None:
    """Remove a result from the store, so that its task runs again."""
    folder = folder_of(out, identity.partition(":")[0], key)
    with suppress(OSError):
        (folder / OUTCOME).unlink()


# jobs that need one of these are refused without it; in the digest, so that they run again once it is installed
OPTIONAL = ("pandas", "pyarrow")
_SUFFIXES = {".py", ".toml", ".j2", ".css", ".js", ".html"}
_ROOT = Path(__file__).resolve().parents[2]


@lru_cache(maxsize=1)
def program_digest() -> str:
    """Return the SHA-256 over all source files and the versions of the numerical libraries.

    It is part of each key, because another program may compute other results.
    """
    digest = hashlib.sha256(json.dumps({**versions(), **_optional()}, sort_keys=True).encode())
    for room in (*PACKAGES, "millfrf"):
        files = [path for path in (_ROOT / room).rglob("*") if path.suffix in _SUFFIXES and path.is_file()]
        for path in sorted(files):
            digest.update(path.relative_to(_ROOT).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()


def _optional() -> dict[str, str]:
    installed = {}
    for name in OPTIONAL:
        try:
            installed[name] = version(name)
        except PackageNotFoundError:
            installed[name] = "none"
    return installed
