"""Notes above the headings of a CSV table: warnings travel with the numbers that they doubt."""

from collections.abc import Iterable, Sequence

WARNING = "# warning: "
"""Beginning of a line that holds one warning."""


def warning_lines(warnings: Sequence[str]) -> list[str]:
    """Write one line for each warning, to stand above the headings.

    Examples
    --------
    >>> warning_lines(["joint 5 is near\\n its limit"])
    ['# warning: joint 5 is near its limit\\n']
    """
    return [f"{WARNING}{' '.join(warning.split())}\n" for warning in warnings]


def apart(lines: Iterable[str]) -> tuple[tuple[str, ...], list[str]]:
    """Warnings, and the lines of a table without those that begin with ``#``.

    Examples
    --------
    >>> apart(["# warning: late\\n", "# anything\\n", "x_m\\n", "1\\n"])
    (('late',), ['x_m\\n', '1\\n'])
    """
    kept = list(lines)
    warnings = tuple(line.removeprefix(WARNING).strip() for line in kept if line.startswith(WARNING))
    return warnings, [line for line in kept if not line.startswith("#")]
