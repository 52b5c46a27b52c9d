"""Recordings that belong together: those with equal labels."""

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import fmean

from millfrf.core import InputError

from ..configuration import FoundRecording, agree, shown_value

Value = str | float


@dataclass(frozen=True)
class RecordingSet:
    """Recordings that are stacked, or diagnosed, together.

    Parameters
    ----------
    name
        Name of the set, such as ``P07 session=2``.
    recordings
        Its recordings, by name.
    labels
        Labels that they share; numbers that differ stand as their mean.
    posture_deg : (n_active,), deg or m
        Joint values that all of them state, or None.
    """

    name: str
    recordings: tuple[FoundRecording, ...]
    labels: dict[str, Value]
    posture_deg: tuple[float, ...] | None

    @property
    def recorded_at(self) -> float | None:
        """Mean time of its recordings, s since 1970, or None."""
        times = [one.recorded_at for one in self.recordings if one.recorded_at is not None]
        return fmean(times) if times else None


def grouped(recordings: Sequence[FoundRecording], by: Sequence[str]) -> tuple[list[RecordingSet], list[FoundRecording]]:
    """Sets of recordings with equal labels, and the recordings that lack one of them.

    Parameters
    ----------
    recordings
        Recordings of the campaign, labelled.
    by
        Labels that must be equal; none: each recording is a set of its own.

    Raises
    ------
    InputError
        A label that no recording has, or two sets of one name.
    """
    if not by:
        return [_set_of(one.name, [one]) for one in recordings], []
    for label in by:
        if not any(label in one.labels.values for one in recordings):
            known = sorted({each for one in recordings for each in one.labels.values})
            raise InputError(
                f"by = {list(by)}: no recording has the label {label}; they have {', '.join(known) or 'none'}"
            )
    together: dict[tuple[Value, ...], list[FoundRecording]] = {}
    lacking = []
    for one in recordings:
        values = one.labels.values
        if all(label in values for label in by):
            together.setdefault(tuple(values[label] for label in by), []).append(one)
        else:
            lacking.append(one)
    sets = [_set_of(_name(by, values), members) for values, members in together.items()]
    _refuse_clashes(sets)
    return sorted(sets, key=lambda one: one.name), lacking


def all_together(recordings: Sequence[FoundRecording], name: str) -> RecordingSet:
    """One set of all recordings."""
    return _set_of(name, recordings)


def _name(by: Sequence[str], values: Sequence[Value]) -> str:
    """Text as it stands, numbers with their label."""
    return " ".join(
        value if isinstance(value, str) else f"{label}={shown_value(value)}"
        for label, value in zip(by, values, strict=True)
    )


def _refuse_clashes(sets: Sequence[RecordingSet]) -> None:
    seen: dict[str, RecordingSet] = {}
    for one in sets:
        first = seen.setdefault(one.name, one)
        if first is not one:
            raise InputError(
                f"two sets have the name {one.name}: that of {first.recordings[0].path.name} and that of "
                f"{one.recordings[0].path.name}; write the values of their labels apart"
            )


def _set_of(name: str, members: Sequence[FoundRecording]) -> RecordingSet:
    sound = [one for one in members if not one.fault] or list(members)
    shared: dict[str, Value] = {}
    for label in sound[0].labels.values:
        values = [one.labels.values.get(label) for one in sound]
        numbers = [value for value in values if isinstance(value, float)]
        if len(numbers) == len(values):
            shared[label] = numbers[0] if len(set(numbers)) == 1 else fmean(numbers)
        elif len(set(values)) == 1 and isinstance(values[0], str):
            shared[label] = values[0]
    return RecordingSet(name, tuple(members), shared, _one_posture([one.labels.posture_deg for one in sound]))


def _one_posture(stated: Sequence[tuple[float, ...] | None]) -> tuple[float, ...] | None:
    """The first of the postures that are stated, if they agree; else None."""
    known = [one for one in stated if one is not None]
    return known[0] if known and all(agree(known[0], one) for one in known) else None
