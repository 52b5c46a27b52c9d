"""Recordings of one pose state one posture: a recording whose notes are those of another pose is found here."""

from collections.abc import Sequence
from dataclasses import replace

from .found_recordings import FoundRecording

POSE = "pose"
"""Label of recordings that were made in one posture."""

SAME = 0.1
"""Largest difference of two statements of one posture, degrees or m: a robot stops more exactly than that."""

Posture = tuple[float, ...]


def without_wrong_postures(recordings: Sequence[FoundRecording]) -> list[FoundRecording]:
    """Give a fault to each recording whose posture contradicts that of the other recordings of its pose.

    What more than half of a pose's recordings state counts. Where no posture has a majority nobody can tell which is
    right, and every recording that states one has the fault.

    Parameters
    ----------
    recordings
        All recordings, labelled.
    """
    stated: dict[str | float, list[FoundRecording]] = {}
    for one in recordings:
        if not one.fault and one.labels.posture_deg is not None and POSE in one.labels.values:
            stated.setdefault(one.labels.values[POSE], []).append(one)
    faults = {
        member.name: fault for pose, members in stated.items() for member, fault in _contradictions(str(pose), members)
    }
    return [replace(one, fault=faults[one.name]) if one.name in faults else one for one in recordings]


def agree(one: Posture, other: Posture) -> bool:
    """Say whether two statements are of one posture.

    Examples
    --------
    >>> agree((10.0, -20.0), (10.01, -20.0)), agree((10.0, -20.0), (12.0, -20.0)), agree((10.0,), (10.0, 0.0))
    (True, False, False)
    """
    return len(one) == len(other) and all(abs(a - b) <= SAME for a, b in zip(one, other, strict=True))


def _contradictions(pose: str, members: Sequence[FoundRecording]) -> list[tuple[FoundRecording, str]]:
    postures = [one.labels.posture_deg or () for one in members]
    support = [sum(agree(one, other) for other in postures) for one in postures]
    most = max(range(len(members)), key=support.__getitem__)
    if support[most] == len(members):
        return []
    if 2 * support[most] <= len(members):
        return [
            (
                one,
                f"{one.path.name}: the {len(members)} recordings of pose {pose} state different postures, none of "
                "them more than half: which is right cannot be told; correct their setups",
            )
            for one in members
        ]
    right = postures[most]
    return [
        (
            one,
            f"{one.path.name}: it states posture_deg = {_shown(own)}, and {support[most]} other recordings of pose "
            f"{pose} state {_shown(right)}; correct its setup, or its label pose",
        )
        for one, own in zip(members, postures, strict=True)
        if not agree(own, right)
    ]


def _shown(posture: Posture) -> str:
    return f"[{', '.join(f'{angle:.6g}' for angle in posture)}]"
