"""Digest of the program: every result hangs on it, and all workers must have the same."""

import hashlib
import json
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from ...hidden_packages import ROOMS
from ...provenance import versions

OPTIONAL = ("pandas", "pyarrow")
"""Libraries that some jobs refuse to do without: a refusal for their sake is forgotten when they are installed."""

_SUFFIXES = {".py", ".toml", ".j2", ".css", ".js", ".html"}
_ROOT = Path(__file__).resolve().parents[3]


@lru_cache(maxsize=1)
def program_digest() -> str:
    """SHA-256 over the files of the program and the versions of the libraries that compute."""
    digest = hashlib.sha256(json.dumps({**versions(), **_optional()}, sort_keys=True).encode())
    for room in (*ROOMS, "millfrf"):
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
