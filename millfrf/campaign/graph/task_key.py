"""Key of a task's result: what went into it, as one number."""

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path

from .task import Task


def key_of(task: Task, digests: Sequence[str], keys_of_needs: Sequence[str], program: str) -> str:
    """SHA-256 over all that the result depends on, as hexadecimal text.

    Parameters
    ----------
    task
        Task whose result is meant. Its own name does not count; names of its files do, since results state them.
    digests
        SHA-256 of each of its files.
    keys_of_needs
        Key of each task that it needs.
    program
        Digest of the program and of the libraries that compute.

    Examples
    --------
    >>> one = Task("fit", "P01", needs=("estimate:P01",), settings={"band_hz": [8.0, 60.0]})
    >>> other = Task("fit", "P02", needs=("estimate:P01",), settings={"band_hz": [8.0, 60.0]})
    >>> key_of(one, [], ["ab"], "1") == key_of(other, [], ["ab"], "1")
    True
    >>> key_of(one, [], ["ab"], "1") == key_of(one, [], ["cd"], "1")
    False
    """
    content = {
        "kind": task.kind,
        "settings": dict(task.settings),
        "files": [[Path(path).name, digest] for path, digest in zip(task.files, digests, strict=True)],
        "needs": list(keys_of_needs),
        "program": program,
    }
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
