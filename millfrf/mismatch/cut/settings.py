"""`CutSettings` and `CUT`: every threshold of a comparison of cutting forces, with its meaning and its source."""

from dataclasses import dataclass

from ..inference.paired_tests import students_test
from ..inference.settings import EvidenceSettings, ProofSettings, SearchSettings, Settings, VerdictSettings


@dataclass(frozen=True)
class CutSettings(Settings):
    """Thresholds of every comparison, and those that a cutting force alone needs; take :data:`CUT` and replace.

    Parameters
    ----------
    coefficient_error
        One standard deviation of what a laboratory's force coefficients are off, a share. It is a choice of this
        project, no published figure.
    force_error
        Share by which each spectral line of a right computed force is still off; what is smaller is not named. It is
        a choice of this project, no published figure.
    odd
        Number of a laboratory's standard deviations by which a coefficient must be off to be named; chance alone
        exceeds it once in 370.
    chance
        Probability that a spectral line of noise passes for something left over: none of some ten thousand lines does.
    usual_errors
        Multiple of ``force_error`` by which a line of the computed force may be off before it is left over.
    """

    coefficient_error: float = 0.15
    force_error: float = 0.01
    odd: float = 3.0
    chance: float = 1e-7
    usual_errors: float = 3.0


CUT = CutSettings(
    # 6 is a likelihood ratio of 20
    evidence=EvidenceSettings(least=20.0, as_good=6.0, clear=4.0),
    # every cause of the library may act beside the others: the search ends when none is left
    search=SearchSettings(most_causes=99),
    # a recording may have as few as four blocks: no ranks of fewer than seven reach this significance (2^-7 < 0.01)
    proof=ProofSettings(gain=10.0, significance=0.01, test=students_test),
    # a residual of noise alone has up to 8 % beyond noise where the computed force is large; without an upper share for
    # "explained" the rest must look like noise
    verdict=VerdictSettings(noise_like=0.08, explained=1.0, partly=0.5),
)
"""Settings of a cut where nothing else is said."""
