"""Key of a task's result: what went into it, as one number."""

import hashlib
import json
from collections.abc import Mapping, Sequence
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


def keys_of(tasks: Mapping[str, Task], digests: Mapping[str, str], program: str) -> dict[str, str | None]:
    """Key of every task; None where the content of a file that it hangs on is not known yet.

    Parameters
    ----------
    tasks
        Tasks by identity, each after those that it needs.
    digests
        SHA-256 by path of the file; empty: not known.
    program
        Digest of the program and of the libraries that compute.
    """
    keys: dict[str, str | None] = {}
    for identity, task in tasks.items():
        of_files, of_needs = [digests[path] for path in task.files], [keys[need] for need in task.needs]
        known = all(of_files) and all(of_needs)
        keys[identity] = key_of(task, of_files, [key for key in of_needs if key], program) if known else None
    return keys
