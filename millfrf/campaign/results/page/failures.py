"""The section of what failed: one line each, so that nothing is hidden."""

from collections.abc import Sequence

from ....report import Section
from ....tables import Table
from ..read_set import SetResults


def all_failures(sets: Sequence[SetResults], failures: Sequence[str]) -> tuple[tuple[str, str], ...]:
    """Give each failure with the set that it belongs to, each once; those of the whole campaign come first.

    Parameters
    ----------
    sets
        Sets of the campaign, as read.
    failures
        Failures that the campaign lists, one line each.
    """
    own = [(one.name, line) for one in sets for line in one.failures if line not in failures]
    return tuple(dict.fromkeys([("", line) for line in failures] + own))


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
