"""Every FRF that a mapping names, one by one: entries, and lists along responses or excitations written out."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from foundation import InputError

from .frf_mapping import EntryMapping, FrfMapping

Places = Mapping[str, int | str]


@dataclass(frozen=True)
class OneFrf:
    """An entry of a mapping with one response, one excitation and one place for each part.

    Parameters
    ----------
    response, excitation
        Degrees of freedom, ``node:direction``.
    given
        Places of those parts that the entry names, by part.
    file, record, averages
        Name of the file, place of its data set and number of averages, as in an `EntryMapping`.
    """

    response: str
    excitation: str
    given: Places = field(default_factory=dict)
    file: str | None = None
    record: int | None = None
    averages: int | None = None


def single_frfs(mapping: FrfMapping) -> tuple[OneFrf, ...]:
    """All FRFs that a mapping names; empty where it names none.

    Parts that are lists under ``[frf]`` run along its responses, for each entry that has an excitation only; along its
    excitations, for each entry that has a response only; without entries along whichever has several.

    Raises
    ------
    InputError
        Lists of different lengths, or an entry of which response and excitation are not known.
    """
    entries = mapping.entries or ((_implied(mapping),) if mapping.frf.listed else ())
    return tuple(one for number, entry in enumerate(entries, 1) for one in _of_entry(mapping, entry, number))


def _implied(mapping: FrfMapping) -> EntryMapping:
    """Give the end that is the same for all FRFs of a list, where the mapping has no entries."""
    table = mapping.frf
    if len(table.excitations) == 1:
        return EntryMapping(excitation=table.excitations[0])
    if len(table.responses) == 1:
        return EntryMapping(response=table.responses[0])
    raise InputError(
        "parts under [frf] are lists, but there are several responses and several excitations, or none; name one of "
        "either there, or give entries"
    )


def _of_entry(mapping: FrfMapping, entry: EntryMapping, number: int) -> list[OneFrf]:
    """FRFs of one entry."""
    lists = {**mapping.frf.listed, **entry.listed}
    if entry.response is not None and entry.excitation is not None:
        return [OneFrf(entry.response, entry.excitation, entry.given, entry.file, entry.record, entry.averages)]
    if entry.response is None and entry.excitation is None:
        raise InputError(f"entries[{number}] names neither response nor excitation; give both, or one and a list")
    along = "responses" if entry.response is None else "excitations"
    labels: tuple[str, ...] = getattr(mapping.frf, along)
    lengths = {along: len(labels), **{name: len(places) for name, places in lists.items()}}
    if not lists or len(set(lengths.values())) > 1:
        said = ", ".join(f"{length} {name}" for name, length in lengths.items())
        raise InputError(
            f"entries[{number}] has no {along.removesuffix('s')}: give it, or under [frf] {along} and lists of as many "
            f"values, real, imaginary ... (there are {said})"
        )
    found = []
    for k, label in enumerate(labels):
        given = {name: places[k] for name, places in lists.items()} | entry.given
        ends = (entry.response or label, entry.excitation or label)
        found.append(OneFrf(*ends, given, entry.file, entry.record, entry.averages))
    return found
