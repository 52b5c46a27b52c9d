"""The line under the title of a diagnosis."""

from datetime import UTC, datetime

from ...provenance import versions


def made_when(*, dated: bool = True) -> str:
    """Program and, where it is wanted, time of writing.

    Parameters
    ----------
    dated
        Whether the time is told; without, equal input gives equal pages.
    """
    program = f"millfrf {versions()['millfrf']}"
    return f"Written {datetime.now(UTC):%Y-%m-%d %H:%M} UTC by {program}" if dated else f"Made by {program}"
