"""Means by which a recording survives: spare disk space, a sync each second, a lock that dies with its writer."""

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
except ImportError:  # Windows: HDF5's own locks must do
    _fcntl = None


class SpareSpace:
    """Disk space held by an unnamed file, given back when the disk is full so that the recording can be closed.

    It vanishes with the process that holds it, however that ends.

    Parameters
    ----------
    folder
        Folder on the disk that is written to.
    size
        Number of bytes to hold; more than the metadata and the block in hand.

    Raises
    ------
    InputError
        That much is not free now.
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
            except OSError as error:
                if is_disk_full(error):
                    raise
        self._file.write(bytes(size))
        self._file.flush()

    def release(self) -> None:
        """Give the space back; harmless when done before."""
        self._file.close()


class Syncer:
    """A thread that asks the system to put a file on the disk itself, once a second; and a lock for its writer.

    What was flushed survives the writer's death at once; a power failure costs at most about the period.

    Parameters
    ----------
    path
        The file; it must exist.
    period
        s between two syncs.
    """

    def __init__(self, path: Path, period: float = 1.0) -> None:
        self._descriptor = os.open(path, os.O_RDWR)
        if _fcntl is not None:
            with contextlib.suppress(OSError):  # some network disks know no locks
                _fcntl.flock(self._descriptor, _fcntl.LOCK_SH | _fcntl.LOCK_NB)
        self._period = period
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"sync {path.name}", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._ended.wait(self._period):
            try:
                os.fsync(self._descriptor)
            except OSError:  # a full disk is told by the next write
                continue

    def close(self) -> None:
        """Sync a last time and let go of the lock."""
        if self._ended.is_set():
            return
        self._ended.set()
        self._thread.join()
        try:
            os.fsync(self._descriptor)
        except OSError:
            pass
        finally:
            os.close(self._descriptor)


def is_being_written(path: Path) -> bool:
    """Whether a living writer holds the file's lock (False where the system has no such locks)."""
    if _fcntl is None:
        return False
    descriptor = os.open(path, os.O_RDONLY)
    try:
        _fcntl.flock(descriptor, _fcntl.LOCK_EX | _fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:  # some network disks know no locks
        return False
    finally:
        os.close(descriptor)
    return False
