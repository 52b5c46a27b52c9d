"""Do samples agree with the host's clock? A wrong rate moves every resonance, a gap shifts what follows."""

from acquisition import ClockFindings, Recording, check_clock
from millfrf.core import InputError


def clock_concerns(recording: Recording, stream: str) -> list[str]:
    """Doubts about the rate and the gaps of a stream, one sentence each; empty where the pairs say nothing.

    Parameters
    ----------
    recording
        Recording, open for reading, whose pairs are looked at.
    stream
        Name of the stream.
    """
    found = _findings(recording, stream)
    return [*([_wrong_rate(found, stream)] if found.rate_is_wrong else []), *_gaps(found, stream)]


def check_clock_of(recording: Recording, stream: str) -> list[str]:
    """Refuse a stream whose sample rate is wrong; returns doubts about gaps.

    Parameters
    ----------
    recording
        Recording, open for reading, whose pairs are looked at.
    stream
        Name of the stream.

    Raises
    ------
    InputError
        The true rate is another one than the file says.
    """
    found = _findings(recording, stream)
    if found.rate_is_wrong:
        raise InputError(f"{recording.path.name}: {_wrong_rate(found, stream)}")
    return _gaps(found, stream)


def missing_concerns(recording: Recording, stream: str) -> list[str]:
    """Doubts about rows that a recovery could not give back, one sentence in all.

    Parameters
    ----------
    recording
        Recording, open for reading, whose pairs are looked at.
    stream
        Name of the stream.
    """
    gone = recording.missing(stream)
    if not gone:
        return []
    count = sum(one.end - one.first for one in gone)
    first = gone[0]
    return [
        f"{count} samples of stream {stream} are missing in {len(gone)} places, the first at samples {first.first} to "
        f"{first.end - 1} ({first.reason}): leave them out with 'estimate --exclude', or record again"
    ]


def _findings(recording: Recording, stream: str) -> ClockFindings:
    return check_clock(recording.clock_pairs(stream), recording.stream(stream).sample_rate)


def _wrong_rate(found: ClockFindings, stream: str) -> str:
    percent = 100 * (found.true_rate / found.stated_rate - 1)
    return (
        f"stream {stream} has a sample rate of {found.true_rate:.4g} Hz by the computer that recorded it, "
        f"and the file says {found.stated_rate:.6g} Hz ({percent:+.2g} %): every frequency would be off as much; "
        "check the device's clock, and record again"
    )


def _gaps(found: ClockFindings, stream: str) -> list[str]:
    if not found.gaps:
        return []
    first = found.gaps[0]
    more = f", and {len(found.gaps) - 1} more" if len(found.gaps) > 1 else ""
    return [
        f"stream {stream}: {first.seconds:.2g} s are missing after {first.after_sample / found.stated_rate:.4g} s by "
        f"the computer that recorded it{more}: samples were lost there, or the computer was asleep; record again, or "
        "cut out what lies on one side of the gap with 'millfrf convert --span'"
    ]
