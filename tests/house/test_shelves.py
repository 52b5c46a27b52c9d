"""At most a dozen modules side by side, unless all are of one kind; no circle of imports."""

from collections import Counter
from typing import Any

import pytest

MOST = 12
"""Modules side by side at most, ``__init__`` not counted: what a reader takes in at one look."""

ONE_KIND = {
    "millfrf.commands": "one command a file",
    "millfrf.gate": "one question of the gate a file",
    "millfrf.robot.commands": "one command a file",
    "mismatch.physics": "one physics a file",
}
"""Folders that hold more, because all their modules are of the kind named here."""

NOT_YET: set[str] = set()
"""Rooms that are still being divided."""

UPWARDS = {("foundation.results.drawing", "figures")}
"""The one way up: a result asks the room of figures to draw it, at the time of the call (docs/decisions/0018)."""


def test_at_most_a_dozen_modules_stand_side_by_side(house: Any) -> None:
    inside = [name for name in house.files if name.split(".")[0] in house.rooms]
    counts = Counter(name.rpartition(".")[0] for name in inside if not house.is_package(name))
    crowded = {
        folder: count
        for folder, count in counts.items()
        if count > MOST and folder not in ONE_KIND and folder.split(".")[0] not in NOT_YET
    }
    assert not crowded, f"divide these into shelves, or name their kind: {crowded}"
    assert set(ONE_KIND) <= {folder for folder, count in counts.items() if count > MOST}, "a kind that needs no name"


def _edges(house: Any) -> dict[str, set[str]]:
    """From each module to those in which the names that it imports are defined; types alone do not count."""
    edges: dict[str, set[str]] = {name: set() for name in house.files}
    for one in house.imports:
        home = house.home_of(one.module, one.name)
        upwards = any(one.importer == low and home.split(".")[0] == high for low, high in UPWARDS)
        if home in edges and home != one.importer and not one.typing_only and not upwards:
            edges[one.importer].add(home)
    return {
        name: set() if house.is_package(name) and house.files[name].with_suffix(".pyi").exists() else targets
        for name, targets in edges.items()
    }


def _circle(edges: dict[str, set[str]]) -> list[str]:
    """One circle of modules, or nothing: depth first, with the path that leads to where one stands."""
    done: set[str] = set()

    def search(name: str, path: list[str]) -> list[str]:
        if name in path:
            return [*path[path.index(name) :], name]
        if name in done:
            return []
        for target in sorted(edges.get(name, ())):
            found = search(target, [*path, name])
            if found:
                return found
        done.add(name)
        return []

    return next((found for name in sorted(edges) if (found := search(name, []))), [])


def test_no_circle_among_modules(house: Any) -> None:
    edges = _edges(house)
    assert sum(map(len, edges.values())) > 1000, "the imports were not read"
    circle = _circle({name: targets for name, targets in edges.items() if name.split(".")[0] not in NOT_YET})
    assert not circle, " -> ".join(circle)


@pytest.mark.parametrize(
    ("edges", "length"), [({"a": {"b"}, "b": {"c"}, "c": {"a"}}, 4), ({"a": {"b", "c"}, "b": {"c"}, "c": set()}, 0)]
)
def test_circles_are_found(edges: dict[str, set[str]], length: int) -> None:
    assert len(_circle(edges)) == length
