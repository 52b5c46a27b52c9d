"""Degrees of freedom: a node and a signed direction, such as ``TCP:+X``."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from .errors import InputError

TIP = ("TCP:+X", "TCP:+Y", "TCP:+Z")
"""Translations of the tool's tip."""

HOUSING = ("HOUSING:+X", "HOUSING:+Y", "HOUSING:+Z")
"""Translations of the spindle's housing."""

_PATTERN = re.compile(r"^(?P<node>[^:]+):(?P<sign>[+-])(?P<axis>R?[XYZ]|S)$")


@dataclass(frozen=True)
class DegreeOfFreedom:
    """A point and a signed axis along which a force acts or a motion is measured.

    Parameters
    ----------
    node
        Name of the point, for example ``TCP`` or ``HOUSING``.
    direction
        ``+X -X +Y -Y +Z -Z`` (translation), ``+RX`` ... (rotation) or ``+S`` (scalar, no direction).

    Raises
    ------
    InputError
        The direction is none of these, or the node is empty or holds a colon.

    Examples
    --------
    >>> DegreeOfFreedom.parse("TCP:-Y").direction
    '-Y'
    >>> str(DegreeOfFreedom("HOUSING", "+X"))
    'HOUSING:+X'
    """

    node: str
    direction: str

    def __post_init__(self) -> None:
        if _PATTERN.match(f"{self.node}:{self.direction}") is None:
            raise InputError(
                f"degree of freedom {self.node}:{self.direction!s} is not understood; "
                "write node:direction with a direction such as +X, -Y or +RZ"
            )

    @classmethod
    def parse(cls, text: str) -> "DegreeOfFreedom":
        """Read a degree of freedom from ``node:direction``."""
        node, _, direction = text.partition(":")
        return cls(node, direction)

    @property
    def sign(self) -> float:
        """Sign of the direction, +1 or -1."""
        return -1.0 if self.direction.startswith("-") else 1.0

    @property
    def axis(self) -> str:
        """The direction without its sign: ``X`` ... ``RZ`` or ``S``."""
        return self.direction[1:]

    def __str__(self) -> str:
        return f"{self.node}:{self.direction}"


def checked_names(names: Sequence[object], owner: str) -> tuple[str, ...]:
    """Return names of degrees of freedom as a tuple of texts.

    Parameters
    ----------
    names
        Names along an axis of a matrix, as read from a file.
    owner
        Owner of the axis, for the message: ``FRF``, ``modal model``.

    Raises
    ------
    InputError
        A name that is no text, such as a number or a missing value.

    Examples
    --------
    >>> checked_names(["TCP:+X"], "FRF")
    ('TCP:+X',)
    """
    for name in names:
        if not isinstance(name, str):
            raise InputError(f"{owner}: degree of freedom {name!r} is no text; write node:direction, such as TCP:+X")
    return tuple(map(str, names))
