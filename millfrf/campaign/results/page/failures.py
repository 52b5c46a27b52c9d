"""The section of what failed: one line each, so that nothing is hidden."""

from collections.abc import Sequence

from ....report import Section
from ....tables import Table
from ..read_set import SetResults


def all_failures(sets: Sequence[SetResults], failures: Sequence[str]) -> tuple[tuple[str, str], ...]:
    """Give each failure with the set that it belongs to, each reason once; those that the campaign lists come first.

    Parameters
    ----------
    sets
        Sets of the campaign, as read.
    failures
        Failures that the campaign lists, one line each.
    """
    found: dict[str, str] = dict.fromkeys(failures, "")
    for one in sets:
        for line in one.failures:
            reason = line.partition(": ")[2] or line
            said = next((known for known in found if known.endswith(reason)), line)
            found[said] = found.get(said) or one.name
    return tuple((name, line) for line, name in found.items())


def failure_section(failed: Sequence[tuple[str, str]]) -> Section:
    """Table of what failed, or the sentence that nothing did.

    Parameters
    ----------
    failed
        Name of the set (empty: of the campaign) and reason of each failure.
    """
    if not failed:
        return Section("Failures", ("Nothing failed.",))
    rows = tuple((name or "campaign", line) for name, line in failed)
    return Section("Failures", (), (Table("What failed, and why", ("set", "reason"), rows),))
