"""Points that were hit and measured in each test: labels of the matrix, signs, and which tests belong together."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from foundation import DegreeOfFreedom, InputError

from .sums import TapSums

Real = NDArray[np.float64]


def labels_of(tests: Sequence[TapSums], axis: str) -> list[str]:
    """Each degree of freedom once, with the sign that it has where it comes first."""
    seen: dict[str, str] = {}
    for test in tests:
        for label in getattr(test, axis):
            seen.setdefault(unsigned(label)[0], label)
    return list(seen.values())


def unsigned(label: str) -> tuple[str, float]:
    """Node and axis without the sign, and the sign; a label that is no degree of freedom stays as it is."""
    if ":" not in label:
        return label, 1.0
    place = DegreeOfFreedom.parse(label)
    return f"{place.node}:{place.axis}", place.sign


def turned(test: TapSums, excitations: Sequence[str], responses: Sequence[str]) -> TapSums:
    """The test in the signs of the matrix."""
    known = {unsigned(label)[0]: label for label in excitations}
    forces, turn_f = _renamed(test.excitations, known)
    places, turn_x = _renamed(test.responses, {unsigned(label)[0]: label for label in responses})
    return replace(
        test,
        input_power=test.input_power * turn_f[:, None] * turn_f,
        cross=test.cross * turn_x[:, None] * turn_f,
        excitations=forces,
        responses=places,
    )


def _renamed(labels: Sequence[str], known: dict[str, str]) -> tuple[tuple[str, ...], Real]:
    names = tuple(known[unsigned(label)[0]] for label in labels)
    signs = [unsigned(old)[1] * unsigned(new)[1] for old, new in zip(labels, names, strict=True)]
    return names, np.array(signs)


def check_whole(tests: Sequence[TapSums], responses: Sequence[str], excitations: Sequence[str]) -> None:
    """Refuse a matrix with entries that no test measured."""
    measured = {
        (p, q)
        for test in tests
        for p in test.responses
        for q, count in zip(test.excitations, test.counts, strict=True)
        if count
    }
    missing = [f"{p} / {q}" for p in responses for q in excitations if (p, q) not in measured]
    if missing:
        more = f" and {len(missing) - 6} more" if len(missing) > 6 else ""
        raise InputError(
            f"no tap gives {', '.join(missing[:6])}{more} (response / point hit): {len(missing)} of "
            f"{len(responses) * len(excitations)} entries are missing; record them, or leave out the files or "
            "the channels (responses, --response) whose rows or columns are not whole"
        )


def blocks(
    tests: Sequence[TapSums], responses: Sequence[str], excitations: Sequence[str]
) -> Iterator[tuple[list[int], list[int], list[TapSums]]]:
    """Rows and columns that are solved together, with the tests that measured them."""
    for group in groups_of(tests):
        columns = [k for k, label in enumerate(excitations) if label in group]
        members = [test for test in tests if group & set(test.excitations)]
        together: dict[tuple[int, ...], list[int]] = {}
        for row, label in enumerate(responses):
            key = tuple(k for k, test in enumerate(members) if label in test.responses)
            together.setdefault(key, []).append(row)
        for key, rows in together.items():
            yield rows, columns, [members[k] for k in key]


def groups_of(tests: Sequence[TapSums]) -> list[set[str]]:
    """Excitations that are linked by tests that measured them at once."""
    groups: list[set[str]] = []
    for test in tests:
        linked = [group for group in groups if group & set(test.excitations)]
        groups = [group for group in groups if group not in linked]
        groups.append(set(test.excitations).union(*linked))
    return groups
