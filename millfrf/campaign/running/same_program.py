"""Digest of the program: every result hangs on it, and all workers must have the same."""

import hashlib
import json
from functools import lru_cache
from pathlib import Path

from ...hidden_packages import ROOMS
from ...provenance import versions

_SUFFIXES = {".py", ".toml", ".j2", ".css", ".js", ".html"}
_ROOT = Path(__file__).resolve().parents[3]


@lru_cache(maxsize=1)
def program_digest() -> str:
    """SHA-256 over the files of the program and the versions of the libraries that compute."""
    digest = hashlib.sha256(json.dumps(versions(), sort_keys=True).encode())
    for room in (*ROOMS, "millfrf"):
        files = [path for path in (_ROOT / room).rglob("*") if path.suffix in _SUFFIXES and path.is_file()]
        for path in sorted(files):
            digest.update(path.relative_to(_ROOT).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()
