"""Degrees of freedom in words that stay short."""

from collections.abc import Sequence

MOST = 8
"""Names that are listed."""


def points_in_words(dofs: Sequence[str]) -> str:
    """All names where they are few, else how many with the first and the last.

    Examples
    --------
    >>> points_in_words(["A:+X", "A:+Y"]), points_in_words([f"{k}:+Z" for k in range(1, 75)])
    ('A:+X, A:+Y', '74 points (1:+Z ... 74:+Z)')
    """
    if len(dofs) <= MOST:
        return ", ".join(dofs)
    return f"{len(dofs)} points ({dofs[0]} ... {dofs[-1]})"
