"""Coherences of UFF files, and the FRFs to which they belong."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from foundation import FileFormatError

from ...frf_matrix import Frf
from ..entries import FrfEntry

ORDINARY, MULTIPLE = 6, 26
"""Function types of data set 58."""

_NAMED = 3

Real = NDArray[np.float64]


@dataclass(frozen=True)
class Coherence:
    """One coherence as a file holds it.

    Parameters
    ----------
    response, excitation
        Degrees of freedom, ``node:direction``.
    values : (n_frequencies,)
        Ordinary coherence of each line, 0 to 1.
    has_reference
        Whether the file names a node of the excitation; some programs leave it out.
    source
        Name of the file and place in it, for messages.
    """

    response: str
    excitation: str
    values: Real
    has_reference: bool
    source: str

    @property
    def name(self) -> str:
        """Name of the entry, ``response / excitation``."""
        return f"{self.response} / {self.excitation}"


def coherences_of(
    functions: Sequence[Mapping[str, Any]], kind: int, labels: Mapping[int, tuple[str, str]], sources: Mapping[int, str]
) -> list[Coherence]:
    """All coherences of one function type among data sets 58 whose degrees of freedom are known."""
    return [
        Coherence(
            *labels[one["place"]], np.real(one["data"]).astype(float), int(one["ref_node"]) > 0, sources[one["place"]]
        )
        for one in functions
        if one["func_type"] == kind and one["place"] in labels
    ]


def with_coherences(
    entries: Sequence[FrfEntry], coherences: Sequence[Coherence]
) -> tuple[list[FrfEntry], tuple[str, ...]]:
    """Entries with their ordinary coherence, matched by response and excitation; also what belongs to none.

    A coherence without a reference belongs to the only FRF of its response.

    Raises
    ------
    FileFormatError
        A coherence that is given twice, or is as long as no FRF.
    """
    given: dict[tuple[str, str], Coherence] = {}
    lost: list[str] = []
    known = {(entry.response, entry.excitation) for entry in entries}
    for one in coherences:
        ends = [end for end in known if end[0] == one.response]
        place = (one.response, one.excitation)
        if place not in known and not one.has_reference and len(ends) == 1:
            place = ends[0]
        if place not in known:
            lost.append(one.name)
        elif place in given:
            raise FileFormatError(f"{one.source} gives the coherence of {one.name} twice; export it once")
        else:
            given[place] = one
    found = [_with(entry, given.get((entry.response, entry.excitation))) for entry in entries]
    more = f" and {len(lost) - _NAMED} more" if len(lost) > _NAMED else ""
    said = f"coherence of {', '.join(lost[:_NAMED])}{more} belongs to none of the FRFs and is left out"
    return found, (said,) if lost else ()


def _with(entry: FrfEntry, coherence: Coherence | None) -> FrfEntry:
    if coherence is None:
        return entry
    if len(coherence.values) != len(entry.values):
        raise FileFormatError(
            f"{coherence.source}: {entry.name} has {len(entry.values)} lines, its coherence {len(coherence.values)}; "
            "export both on one frequency axis"
        )
    return replace(entry, coherence=coherence.values)


def with_multiple_coherence(frf: Frf, coherences: Sequence[Coherence]) -> Frf:
    """The FRF with its multiple coherence, where each response has one on the axis of the FRF."""
    found = {one.response: one.values for one in coherences if len(one.values) == len(frf.frequencies)}
    if not all(response in found for response in frf.responses):
        return frf
    return replace(frf, multiple_coherence=np.stack([found[response] for response in frf.responses], axis=1))
