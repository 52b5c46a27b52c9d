"""`StructureDetails`: the fits and recordings of a diagnosis, from which its maps, figures and reports are made."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

from estimation import WindowedSpectrum

from ..behaviour import Behaviour
from ..inference import Diagnosis
from ..models import Fit, Hypothesis
from ..records import ComparedBand

if TYPE_CHECKING:
    from .view_of_residual import ResidualView


@dataclass(frozen=True)
class StructureDetails:
    """Fits and recordings with which the diagnosis of a structure was made.

    Parameters
    ----------
    base, final
        Fit without any cause, and fit with the causes that are reported.
    recordings
        Recordings with tones taken out and clipping mended, weakest first.
    measured
        The same recordings as they were measured.
    elsewhere
        Hypothesis with modal parameters alone, and final hypothesis, both fitted without the recording held out.
    held_out
        What those fits did not see, as it was measured: a recording, or a part of it.
    band
        Band in which model and recordings are compared, and why.
    view
        Maps of the residual before and after the causes are added; None until they are made.
    delay
        Delay of the measuring chain that the nominal model states, s: it was taken out of the recordings.
    behaviour
        What modes do with the level, whatever law stands behind it; None where it was not asked for.
    textbook
        The hypothesis with laws as the library has them, where those of ``final`` have a free form; else None.
    """

    base: Fit
    final: Fit
    recordings: tuple[WindowedSpectrum, ...]
    measured: tuple[WindowedSpectrum, ...]
    elsewhere: tuple[Hypothesis, Hypothesis]
    held_out: WindowedSpectrum
    band: ComparedBand
    view: "ResidualView | None" = None
    delay: float = 0.0
    behaviour: Behaviour | None = None
    textbook: Hypothesis | None = None

    @property
    def tested(self) -> bool:
        """Whether there was data that those fits did not see; of a single short recording there is none."""
        return len(self.recordings) > 1 or self.held_out is not self.measured[0]


StructureDiagnosis: TypeAlias = Diagnosis[StructureDetails]
"""The diagnosis of a structure."""
