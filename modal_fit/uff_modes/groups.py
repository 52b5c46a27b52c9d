"""Names of degrees of freedom in a UFF file of modes, as permanent groups of one node (data set 2477).

Data set 55 knows nodes by number only and has no place for names, signs or the order of degrees of freedom. Its five
lines of text end after 80 characters, so that names written there were lost from some ten points on.
"""

from collections.abc import Mapping
from pathlib import Path

from acquisition import read_uff_lines
from foundation import FileFormatError, InputError

_KIND, _NODE = 2477, 7
_LONGEST = 40
_IN_LINE = 2


def group_set(sides: Mapping[str, Mapping[str, int]]) -> str:
    """Data set 2477 with one group a degree of freedom, ``right 1 TCP:+X``.

    Parameters
    ----------
    sides
        Node number by degree of freedom, by side.

    Raises
    ------
    InputError
        A name longer than the 40 characters of a group's.
    """
    lines, number = ["    -1", f"{_KIND:6d}"], 0
    for side, labels in sides.items():
        for place, (label, node) in enumerate(labels.items(), 1):
            number += 1
            name = f"{side} {place} {label}"
            if len(name) > _LONGEST:
                raise InputError(
                    f"degree of freedom {label} is too long for the 40 characters of a UFF group; shorten it"
                )
            lines += ["".join(f"{n:10d}" for n in (number, 0, 0, 0, 0, 0, 0, 1)), name]
            lines.append("".join(f"{n:10d}" for n in (_NODE, node, 0, 0)))
    return "\n".join([*lines, "    -1", ""])


def vector_labels(path: Path, side: str) -> dict[str, int]:
    """Node number by degree of freedom of one side (``right`` or ``left``), in their order; empty where none is told.

    Raises
    ------
    FileFormatError
        A damaged group.
    """
    found: dict[str, int] = {}
    for one in read_uff_lines(path, (_KIND,)):
        at = 0
        try:
            while at + 1 < len(one.lines):
                n_entities = int(one.lines[at][70:80])
                words = one.lines[at + 1].split(maxsplit=2)
                if len(words) == len(("side", "place", "label")) and words[0] == side:
                    found[words[2].strip()] = int(one.lines[at + 2][10:20])
                at += 2 + -(-n_entities // _IN_LINE)
        except (ValueError, IndexError) as error:
            raise FileFormatError(f"{path}: data set {one.place} (type 2477) is damaged; export it again") from error
    return found
