"""Text of files and users without what a terminal would obey."""

import unicodedata

_REPLACED = "\N{REPLACEMENT CHARACTER}"


def printable(text: str) -> str:
    """Text without what moves a terminal's cursor or paints it; tab and line feed stay.

    Examples
    --------
    >>> printable("ax \\x1b[31m[g]")
    'ax �[31m[g]'
    """
    return "".join(_REPLACED if unicodedata.category(c) == "Cc" and c not in "\t\n" else c for c in text)
