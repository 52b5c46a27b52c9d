"""Recordings that a function takes by the names of their files or opened."""

import os
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from millfrf.core import InputError

from .recording import Recording
from .stream import Stream

RecordingFile = str | os.PathLike[str] | Recording  # path of a recording, or an open one


@contextmanager
def opened(recording: RecordingFile) -> Iterator["Recording"]:
    """Open a recording for a ``with`` block; a recording that is open already is used as it is and stays open.

    Parameters
    ----------
    recording
        Path of a file, or a recording; one that was closed is opened again for the block.
    """
    if isinstance(recording, Recording) and not recording.closed:
        yield recording
    else:
        with Recording(path_of(recording)) as opened_recording:
            yield opened_recording


@contextmanager
def all_opened(recordings: Iterable[RecordingFile]) -> Iterator[list["Recording"]]:
    """Open several recordings for a ``with`` block; see :func:`opened`.

    Parameters
    ----------
    recordings
        Paths of files, or open recordings.
    """
    with ExitStack() as stack:
        yield [stack.enter_context(opened(recording)) for recording in recordings]


def path_of(recording: "RecordingFile | Stream") -> Path:
    """Return the path of the file of a recording.

    Raises
    ------
    InputError
        An object that is neither a path nor a recording.
    """
    if isinstance(recording, Recording | Stream):
        return recording.path
    if isinstance(recording, str | os.PathLike):
        return Path(recording)
    raise InputError(f"a {type(recording).__name__} is no recording; give a recording or the name of its file")
