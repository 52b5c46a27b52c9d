"""Protection of a recording while it is written: spare disk space, a sync each second, and the writer's lock."""

import contextlib
import ctypes
import os
import shutil
import tempfile
import threading
from pathlib import Path
from typing import Any

from millfrf.core import DiskError, InputError, MillfrfError, is_disk_full
from millfrf.core.disk_errors import failure_of_disk, sync_open
from millfrf.core.errors import NotKept
from millfrf.core.file_locks import lock
from millfrf.core.whole_files import free_name, keeping_files, note_made, writing_whole_file


class SpareSpace:
    """Disk space of ``size`` bytes, held by an unnamed file and released when the disk is full.

    HDF5 cannot close a file without room for its metadata. The unnamed file vanishes with its process.
    """

    def __init__(self, folder: Path, size: int) -> None:
        try:
            self._file = tempfile.TemporaryFile(dir=folder)  # noqa: SIM115  # held until it is needed
        except OSError as error:
            raise InputError(f"cannot record in {folder}: {error.strerror}; choose another folder") from error
        try:
            self._fill(size)
        except (OSError, OverflowError, MemoryError) as error:
            with contextlib.suppress(OSError):
                self._file.close()
            if failure := failure_of_disk(error):
                raise DiskError(
                    f"cannot record in {folder}: its disk failed ({failure}); choose another disk"
                ) from error
            raise InputError(
                f"cannot record in {folder}: less than {size / 1e6:.0f} MB free; make room first"
            ) from error

    def _fill(self, size: int) -> None:
        if hasattr(os, "posix_fallocate"):
            try:
                os.posix_fallocate(self._file.fileno(), 0, size)
                return
            except OSError as error:  # some file systems cannot reserve space; then zeros are written
                if is_disk_full(error) or failure_of_disk(error):
                    raise
        self._file.write(bytes(size))
        self._file.flush()

    def release(self) -> None:
        """Give the space back; do nothing if it was released before."""
        self._file.close()


class Syncer:
    """Thread that writes a file to the disk each second, and that holds the lock of the file's writer.

    Flushed data survive the death of the writer at once; a power failure costs about the last second. The first sync
    that fails is the last: the system then forgets which data it could not write, and later syncs succeed without them.

    Parameters
    ----------
    path
        Path at which the file is now.
    place
        Path at which it is to stay.
    """

    def __init__(self, path: Path, place: Path) -> None:
        self._path = place
        self._descriptor = os.open(path, os.O_RDWR)
        lock(self._descriptor, shared=True)  # a disk without locks, or a foreign reader: readers do not wait
        self.failure: OSError | None = None  # of the first sync that failed
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"sync {place.name}", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._stop.wait(1.0) and self.sync():
            pass

    def sync(self) -> bool:
        """Sync the file, unless a sync has failed before; return whether the disk has taken everything."""
        if self.failure is None:
            try:
                sync_open(self._descriptor)
            except OSError as error:
                self.failure = error
        return self.failure is None

    def read(self, address: int, count: int) -> bytes:
        """Read bytes of the file back."""
        os.lseek(self._descriptor, address, os.SEEK_SET)
        return os.read(self._descriptor, count)

    def close(self) -> str:
        """Sync a last time and release the lock; return a line that says what has become of the file if it is gone.

        A file that was removed is saved under another name.
        """
        self._stop.set()
        self._thread.join()
        self.sync()
        try:
            return self._missing()
        finally:
            self.release()

    def release(self) -> None:
        """Release the lock."""
        self._stop.set()
        self._thread.join()
        os.close(self._descriptor)

    def _missing(self) -> str:
        held = os.fstat(self._descriptor)
        try:
            note_made(self._path, held)
        except NotKept:
            cause = f"{self._path} was removed or replaced by another program while it was recorded"
            return f"{cause}; the recording {'has another name now' if held.st_nlink else self._saved()}"
        return ""

    def _saved(self) -> str:
        """Copy the bytes of the removed file into a new one, and return what has become of them."""
        with keeping_files("choose another name"):
            saved = free_name(self._path.with_name(f"{self._path.stem}.saved{self._path.suffix}"))
            try:
                with (
                    writing_whole_file(saved) as temporary,
                    os.fdopen(os.dup(self._descriptor), "rb") as source,
                    temporary.open("wb") as copy,
                ):
                    source.seek(0)
                    shutil.copyfileobj(source, copy)
            except (OSError, MillfrfError) as error:
                return f"is lost: {error}"
        return f"was saved as {saved}"


def failure_of_hdf5(error: BaseException) -> str:
    """Return why HDF5 could not write: in the words of the system, or of the library where it does not name the cause.

    Examples
    --------
    >>> failure_of_hdf5(RuntimeError("Can't destroy cache (slist already enabled?)"))
    "HDF5: can't destroy cache"
    """
    words = str(error).partition(" (")[0]
    return failure_of_disk(error) or f"HDF5: {words[:1].lower()}{words[1:]}"


def abandon(holder: object) -> None:
    """Let HDF5 never touch a file again after it failed to write into it.

    The library can then neither flush nor close the file, and crashes the program when it tries, at the latest when the
    program ends. So the objects of the file are never freed, and the program ends without the library's own end, with
    the exit code that it would have had. Where the system is not Linux with glibc, the program may still crash at its
    end, after its message.
    """
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(holder))
    library: Any = ctypes.CDLL(None) if os.name == "posix" else None
    on_exit = getattr(library, "on_exit", None)  # of glibc: called at exit before what was registered earlier
    if on_exit is not None:
        on_exit(ctypes.cast(library._exit, ctypes.c_void_p), None)
