"""Does a recording of a cut chatter? A computed force repeats with the spindle, a chattering one does not."""

from dataclasses import dataclass

from cutting import MillingProcess
from stability import classify_cut

from .recording import CutRecording

UNSTABLE = ("hopf", "period-doubling")
"""Verdicts that :func:`stability.classify_cut` gives for a cut that is not stable."""

STEADY = 0.01
"""Share by which the speed may change over a recording that is judged; a sweep crosses resonances."""


@dataclass(frozen=True)
class CutChatter:
    """What a recording says about the stability of its cut.

    Parameters
    ----------
    name
        Name of the recording.
    kind
        Kind of :class:`stability.ChatterVerdict`, or ``not judged``.
    frequency
        Chatter frequency, Hz; NaN without chatter.
    share
        Share of the force's root mean square that chatter has.
    reason
        Reason of the judgement, in one sentence.
    """

    name: str
    kind: str
    frequency: float
    share: float
    reason: str

    @property
    def unstable(self) -> bool:
        """Whether the cut chattered."""
        return self.kind in UNSTABLE


def chatter_of(recording: CutRecording, process: MillingProcess) -> CutChatter:
    """Judge the forces of a recording, from where its run-in has ended.

    Parameters
    ----------
    recording
        Recording of a cut at constant or swept speed.
    process
        Cutting process; it gives the number of teeth.
    """
    law, first = recording.law, min(int(recording.run_in * recording.rate), len(recording.force) // 4)
    seconds = len(recording.force) / recording.rate
    drift = abs(law.change) * seconds / law.speed
    if drift > STEADY:
        reason = f"its speed changes by {100 * drift:.2g} %: chatter is judged at constant speed alone"
        return CutChatter(recording.name, "not judged", float("nan"), 0.0, reason)
    found = classify_cut(recording.force[first:], recording.rate, law.speed, process.teeth)
    return CutChatter(recording.name, found.kind, found.frequency, found.share, found.reason)
