"""Several recordings of one job: each a test of its own."""

import os
from collections.abc import Sequence
from pathlib import Path

from millfrf.core import InputError

from ..provenance import sha256


def check_several(paths: Sequence[str | os.PathLike[str]]) -> None:
    """Refuse a recording that is given twice, under one name or as a copy: it would count as two tests.

    Raises
    ------
    InputError
        With both names.
    """
    by_size: dict[int, list[Path]] = {}
    for path in (Path(path) for path in paths):
        if path.is_file():
            by_size.setdefault(path.stat().st_size, []).append(path)
    for alike in (group for group in by_size.values() if len(group) > 1):
        seen: dict[str, Path] = {}
        for path in alike:
            first = seen.setdefault(sha256(path), path)
            if first is not path:
                raise InputError(f"{path.name} is the same recording as {first.name}; give each test once")
