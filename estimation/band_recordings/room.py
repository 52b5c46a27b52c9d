"""Recordings that are held in memory as a whole: how long they may be."""

from acquisition import Stream
from foundation import allowed_bytes, require_memory


def require_room(stream: Stream, n_channels: int, bytes_a_value: float, ratio: float = 1.0) -> None:
    """Refuse a recording that takes more memory than is allowed, before it is read.

    Parameters
    ----------
    stream
        Samples of an open recording.
    n_channels
        Number of channels that are read.
    bytes_a_value : bytes
        Largest memory that the job takes for each value that is kept.
    ratio
        Rate that is kept over that of the recording.

    Raises
    ------
    InputError
        It is too long; the line says how long it may be.
    """
    needed = bytes_a_value * stream.n_samples * ratio * n_channels
    longest = 0.99 * stream.duration * allowed_bytes() / max(needed, 1.0)
    name = stream.path.name
    require_memory(
        needed,
        f"{name}, {stream.duration:.4g} s of {n_channels} channels",
        f"cut a part of at most {longest:.0f} s out with 'millfrf convert {name} part.h5 --span 0 {longest:.0f}'",
    )
