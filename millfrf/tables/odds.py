"""Evidence as odds, in words that need no logarithm."""

import math

SURE = 1e6
"""Odds beyond which a larger number says no more: the error is then in what was assumed, not in chance."""


def odds_in_words(evidence: float) -> str:
    """Odds ``exp(evidence / 2)`` of a cause against its absence, rounded.

    Parameters
    ----------
    evidence
        Gain in score by the cause, twice the natural logarithm of the odds (Kass & Raftery 1995).

    Examples
    --------
    >>> odds_in_words(20.0), odds_in_words(1e4), odds_in_words(2.0)
    ('22 000 to one', 'more than a million to one', 'less than ten to one')
    """
    if evidence >= 2 * math.log(SURE):
        return "more than a million to one"
    if evidence < 2 * math.log(10):
        return "less than ten to one"
    odds = math.exp(evidence / 2)
    rounded = round(odds, 1 - math.floor(math.log10(odds)))
    return f"{rounded:,.0f} to one".replace(",", " ")


def evidence_in_words(evidence: float) -> str:
    """Odds in words, with the number that stands in files.

    Parameters
    ----------
    evidence
        Gain in score by the cause, twice the natural logarithm of the odds.

    Examples
    --------
    >>> evidence_in_words(20.0)
    'odds 22 000 to one (evidence 20)'
    """
    return f"odds {odds_in_words(evidence)} (evidence {evidence:.0f})"
