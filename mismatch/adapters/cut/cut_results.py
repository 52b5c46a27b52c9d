"""What a comparison of measured with computed cutting forces says: `CutDiagnosis`."""

from dataclasses import dataclass
from typing import Any

from cutting import MillingProcess

from ...inference.diagnosis import AcceptedCause, Candidate, Improvement
from .cut_fit import CutFit
from .cut_setting import CutSetting
from .recordings.cut_chatter import CutChatter

COEFFICIENTS = "force_coefficients"
"""Name under which coefficients stand that are off by several times what a laboratory's are."""


@dataclass(frozen=True)
class CutDiagnosis:
    """Which physics the computed cutting force leaves out.

    Parameters
    ----------
    verdict
        ``none``: nothing is left out; ``explained``: the causes leave noise and usual error; ``partly explained``: they
        take away half or more of what stands out, and leave more than that; ``unexplained``: none of them does, or a
        recording chatters.
    physics
        Accepted causes in the order found, then ``force_coefficients`` if they are odd.
    candidates
        All causes with their evidence when last weighed, beside those accepted before; ``stage`` says which could not
        be weighed, and why.
    equivalents
        Causes that explain as much as the first accepted one.
    improvement
        Of the force's error on blocks of time that were not fitted.
    leftover
        Share of the final residual's power that is neither noise nor usual error.
    located
        Spindle orders and channels in which the refitted force without causes is off.
    setting
        Recordings, cutter, noise.
    nominal, base, final
        As the file says; coefficients refitted; with the causes that are told.
    chatter
        What each recording says about the stability of its cut.
    """

    verdict: str
    physics: tuple[AcceptedCause, ...]
    candidates: tuple[Candidate, ...]
    equivalents: tuple[str, ...]
    improvement: Improvement
    leftover: float
    located: dict[str, Any]
    setting: CutSetting
    nominal: CutFit
    base: CutFit
    final: CutFit
    chatter: tuple[CutChatter, ...] = ()

    def improved_process(self) -> MillingProcess:
        """The cutting file's process with refitted coefficients and the accepted causes that it has a place for.

        Nothing but coefficients changes where no cause is named.
        """
        shown = self.final
        process = self.setting.belief.process_at(shown.attempt.deviations)
        for cause, values in shown.attempt.acting:
            if cause.name in shown.freed:
                process = cause.improved(process, values)
        return process
