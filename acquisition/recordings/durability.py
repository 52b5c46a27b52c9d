"""Protection of a recording while it is written: spare disk space, a sync each second, and the writer's lock."""

import contextlib
import os
import tempfile
import threading
from pathlib import Path
from types import ModuleType

from millfrf.core import InputError, is_disk_full

_fcntl: ModuleType | None
try:
    import fcntl as _fcntl
except ImportError:  # Windows: there are only HDF5's own locks
    _fcntl = None


class SpareSpace:
    """Disk space of ``size`` bytes, held by an unnamed file and released when the disk is full.

    HDF5 cannot close a file without room for its metadata. The unnamed file vanishes with its process.
    """

    def __init__(self, folder: Path, size: int) -> None:
        self._file = tempfile.TemporaryFile(dir=folder)  # noqa: SIM115  # held until it is needed
        try:
            self._fill(size)
        except (OSError, OverflowError, MemoryError) as error:
            self._file.close()
            raise InputError(
                f"cannot record in {folder}: less than {size / 1e6:.0f} MB free; make room first"
            ) from error

    def _fill(self, size: int) -> None:
        if hasattr(os, "posix_fallocate"):
            try:
                os.posix_fallocate(self._file.fileno(), 0, size)
                return
            except OSError as error:  # some file systems cannot reserve space; then zeros are written
                if is_disk_full(error):
                    raise
        self._file.write(bytes(size))
        self._file.flush()

    def release(self) -> None:
        """Give the space back; do nothing if it was released before."""
        self._file.close()


class Syncer:
    """Thread that writes a file to the disk each second, and that holds the lock of the file's writer.

    Flushed data survive the death of the writer at once; a power failure costs about the last second.
    """

    def __init__(self, path: Path) -> None:
        self._descriptor = os.open(path, os.O_RDWR)
        if _fcntl is not None:
            with contextlib.suppress(OSError):  # some network disks have no locks
                _fcntl.flock(self._descriptor, _fcntl.LOCK_SH | _fcntl.LOCK_NB)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"sync {path.name}", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._stop.wait(1.0):
            with contextlib.suppress(OSError):  # the next write reports a full disk
                os.fsync(self._descriptor)

    def close(self) -> None:
        """Sync a last time and release the lock."""
        if self._stop.is_set():
            return
        self._stop.set()
        self._thread.join()
        try:
            with contextlib.suppress(OSError):
                os.fsync(self._descriptor)
        finally:
            os.close(self._descriptor)


def is_being_written(path: Path) -> bool:
    """Return whether a running writer holds the file's lock; False if the system has no such locks."""
    if _fcntl is None:
        return False
    descriptor = os.open(path, os.O_RDONLY)
    try:
        _fcntl.flock(descriptor, _fcntl.LOCK_EX | _fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:  # some network disks have no locks
        return False
    finally:
        os.close(descriptor)
    return False
