"""What a full disk looks like, whichever library meets it."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import DiskFull

_FULL = {28, 122, 27}  # ENOSPC, EDQUOT, EFBIG


def is_disk_full(error: BaseException) -> bool:
    """Whether the HDF5 library or the system says, or said to what is raised now, that there is no more room.

    Examples
    --------
    >>> is_disk_full(RuntimeError("Unable to flush (file write failed: errno = 28, error message = 'No space left')"))
    True
    >>> is_disk_full(ValueError("errno = 5"))
    False
    """
    found = re.search(r"errno = (\d+)", str(error))
    says_so = getattr(error, "errno", None) in _FULL or (found is not None and int(found.group(1)) in _FULL)
    return says_so or (error.__cause__ is not None and is_disk_full(error.__cause__))


@contextmanager
def naming_full_disk(target: Path) -> Iterator[None]:
    """Turn whatever a library says of a full disk into one line that names the wanted file.

    Raises
    ------
    DiskFull
        No room was left for it.
    """
    try:
        yield
    except Exception as error:
        if isinstance(error, DiskFull) or is_disk_full(error):
            raise DiskFull(
                f"no room for {target}: its disk or quota is full, or holds no file of that size; nothing was written, "
                "make room or choose another folder"
            ) from error
        raise
