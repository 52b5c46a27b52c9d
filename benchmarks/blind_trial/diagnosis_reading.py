"""What a diagnosis says, read from ``diagnosis.json`` without the library: names, direction, parameters, improvement.

Only the fields of the published format are relied on (``verdict, physics, equivalents, improvement``); inside them
names are matched loosely, for the trial must not depend on how the tool is written.
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Answer:
    """One diagnosis.

    Parameters
    ----------
    verdict
        ``none``, ``explained``, ``unexplained``; ``failed`` where the tool gave no readable file.
    names, equivalents
        Causes accepted, and those it cannot tell from them.
    direction : (3,) or None
        Direction of the first accepted cause that has one.
    parameters
        Name to value and standard error, of all accepted causes.
    removed
        Share of the held-out excess that it claims to have removed, or None.
    """

    verdict: str
    names: tuple[str, ...] = ()
    equivalents: tuple[str, ...] = ()
    direction: NDArray[np.float64] | None = None
    parameters: tuple[tuple[str, float, float], ...] = ()
    removed: float | None = None


FAILED = Answer("failed")


def read_answer(path: Path) -> Answer:
    """Read a diagnosis; anything unreadable counts as failed."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        verdict = str(content["verdict"])
        physics = [entry for entry in content.get("physics", []) if isinstance(entry, dict)]
        names = tuple(str(entry["name"]) for entry in physics if entry["name"] not in ("none", "unexplained"))
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return FAILED
    directions = [result for entry in physics for result in _directions(entry)]
    return Answer(
        verdict,
        names,
        tuple(_name(entry) for entry in content.get("equivalents") or []),
        directions[0] if directions else None,
        tuple(_parameters(physics)),
        _removed(content.get("improvement")),
    )


def _name(entry: Any) -> str:
    return str(entry.get("name", "")) if isinstance(entry, dict) else str(entry)


def _directions(value: Any, key: str = "") -> Iterator[NDArray[np.float64]]:
    """Vectors of three numbers under keys that speak of a direction or location."""
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _directions(inner, f"{key}.{name}")
    elif isinstance(value, list) and len(value) == 3 and all(isinstance(x, int | float) for x in value):
        spoken = "direction" in key or key.endswith("location")
        if spoken and "error" not in key and np.linalg.norm(value) > 0:
            yield np.asarray(value, dtype=float)


def _parameters(physics: list[dict[str, Any]]) -> Iterator[tuple[str, float, float]]:
    for entry in physics:
        values, errors = entry.get("parameters"), entry.get("standard_errors")
        if not isinstance(values, dict) or not isinstance(errors, dict):
            continue
        for name, value in values.items():
            error = errors.get(name)
            if isinstance(value, int | float) and isinstance(error, int | float) and error > 0:
                yield name, float(value), float(error)


def _removed(improvement: Any) -> float | None:
    """``(before - after) / (before - floor)`` from whatever the three are called."""
    if not isinstance(improvement, dict):
        return None
    result: dict[str, float] = {}
    words = {"before": ("before", "nominal"), "after": ("after", "improved"), "floor": ("floor", "noise")}
    for meaning, spellings in words.items():
        for key, value in improvement.items():
            if any(word in key for word in spellings) and meaning not in result:
                number = np.sqrt(np.mean(np.square(value))) if isinstance(value, list) and value else value
                if isinstance(number, int | float | np.floating):
                    result[meaning] = float(number)
    if len(result) < 3 or result["before"] <= 1.2 * result["floor"]:
        return None
    return (result["before"] - result["after"]) / (result["before"] - result["floor"])
