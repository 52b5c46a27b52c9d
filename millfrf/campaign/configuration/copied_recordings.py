"""Recordings that are copies of each other: content that counts twice, or under a label that is not its own."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from .found_recordings import FoundRecording


def without_copies(recordings: Sequence[FoundRecording], digests: Mapping[str, str]) -> list[FoundRecording]:
    """Give a fault to each recording whose content another has, too.

    Of copies with equal labels the first is kept. Where labels differ nobody can tell which copy has its own, and all
    have the fault.

    Parameters
    ----------
    recordings
        Recordings of the campaign, labelled.
    digests
        SHA-256 of the content by the recording's name; empty: not known.
    """
    alike: dict[str, list[FoundRecording]] = {}
    for one in recordings:
        if digests[one.name] and not one.fault:
            alike.setdefault(digests[one.name], []).append(one)
    faults: dict[str, str] = {}
    for copies in alike.values():
        same = all(one.labels == copies[0].labels for one in copies)
        for one in copies[1 if same else 0 :] if len(copies) > 1 else ():
            other = copies[0] if one is not copies[0] else copies[1]
            remedy = "give each test once" if same else "their labels differ, and which are right cannot be told"
            faults[one.name] = f"{one.path.name} is the same recording as {other.path.name}; {remedy}"
    return [replace(one, fault=faults[one.name]) if one.name in faults else one for one in recordings]
