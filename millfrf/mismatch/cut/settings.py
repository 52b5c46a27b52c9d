"""`CutSettings` and `CUT`: all thresholds of a comparison of cutting forces, with meaning and source."""

from dataclasses import dataclass

from ..inference.numerics import students_test
from ..inference.settings import EvidenceSettings, ProofSettings, SearchSettings, Settings, VerdictSettings


@dataclass(frozen=True)
class CutSettings(Settings):
    """Thresholds of every comparison, and those of cutting forces.

    Parameters
    ----------
    coefficient_error
        Standard deviation of the errors of laboratory force coefficients, a share: a choice of this project, no
        published figure.
    force_error
        Relative error of each spectral line of a correct computed force; smaller causes are not reported. A choice of
        this project, no published figure.
    implausible
        Deviation of a coefficient, in laboratory standard deviations, from which it is reported; chance alone exceeds 3
        once in 370.
    chance
        Probability that noise alone makes a spectral line significant: none of some ten thousand lines is.
    usual_errors
        Multiple of ``force_error`` above which a line of the computed force counts as unexplained.
    """

    coefficient_error: float = 0.15
    force_error: float = 0.01
    implausible: float = 3.0
    chance: float = 1e-7
    usual_errors: float = 3.0


# default settings of a cut
CUT = CutSettings(
    # 6 is a likelihood ratio of 20
    evidence=EvidenceSettings(least=20.0, as_good=6.0, clear=4.0),
    # all causes of the library may act together: the search ends when none remains
    search=SearchSettings(most_causes=99),
    # a recording may have only four blocks, but a test of ranks needs seven for this significance (2^-7 < 0.01)
    proof=ProofSettings(gain=10.0, significance=0.01, test=students_test),
    # the residual of noise alone has up to 8 % beyond noise if the computed force is large; with "explained" at 1 the
    # residual must look like noise
    verdict=VerdictSettings(noise_like=0.08, explained=1.0, partly=0.5),
)
