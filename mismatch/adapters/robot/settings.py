"""Thresholds of a robot's comparison: which of the core's differ, and those that only a robot has."""

from dataclasses import dataclass

from ...inference import (
    EvidenceSettings,
    LabError,
    ProofSettings,
    SearchSettings,
    Settings,
    Thresholds,
    VerdictSettings,
)

ROBOT = Settings(
    lab=LabError(frequency=0.01, damping=0.15, shape=0.05),
    evidence=EvidenceSettings(as_good=6.0),
    search=SearchSettings(most_causes=2, most_tested=4),
    proof=ProofSettings(significance=0.01, beaten=0.25),
    verdict=VerdictSettings(noise_like=2.0, explained=0.9, partly=0.5),
)
"""Thresholds of the core that differ for robots.

The modes of a right robot model are off by one per cent, 15 per cent, and a twentieth of a shape's size: choices of
this project, no published figures. Equivalents are within a likelihood ratio of 20. What is left is measured by the
cost for each deviation that the recordings tell: 1 is expected of a right model, up to 2 passes for noise.
"""


@dataclass(frozen=True)
class RobotLimits(Thresholds):
    """Thresholds that only a robot's comparison has.

    Parameters
    ----------
    reach
        Modes up to so many times the band's upper end may deviate: those above the band lend it their flexibility.
    strange
        Deviation, in standard deviations, above which a mode that the recordings show is not taken for one of the
        robot's: 60 are a factor of 1.8 in frequency, more than any change shifts a mode.
    loose
        Precision of the belief under which modes are fitted freely: ten standard deviations then count as one.
    block
        Length of a block of time in the test of held-out errors, s: several time constants of a robot's modes.
    least_blocks
        Blocks below which no signed rank is significant: 7 falls in a row have p = 2^-7 = 0.008 (Wilcoxon 1945).
    """

    reach: float = 3.0
    strange: float = 60.0
    loose: float = 0.01
    block: float = 1.0
    least_blocks: int = 7


LIMITS = RobotLimits()
"""The values that are used."""
