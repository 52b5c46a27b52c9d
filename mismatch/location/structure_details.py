"""`StructureDetails`: what the diagnosis of a structure leaves for its maps, figures and reports."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

from ..inference import Diagnosis
from ..models.fitting import Fit
from ..models.hypothesis import Hypothesis
from ..records.compared_band import ComparedBand
from ..records.windowed_lines import WindowedLines

if TYPE_CHECKING:
    from .residual_view import ResidualView


@dataclass(frozen=True)
class StructureDetails:
    """What the diagnosis of a structure was made with.

    Parameters
    ----------
    base, final
        Fits without any cause, and with those that are told.
    recordings
        Recordings with tones taken out and clipping mended, weakest first.
    measured
        The same recordings as they were measured.
    elsewhere
        Modal parameters alone, and the final hypothesis, fitted without the recording held out.
    band
        Band in which model and recordings are compared, and why.
    view
        Maps of what is left before and after; None before they are made.
    """

    base: Fit
    final: Fit
    recordings: tuple[WindowedLines, ...]
    measured: tuple[WindowedLines, ...]
    elsewhere: tuple[Hypothesis, Hypothesis]
    band: ComparedBand
    view: "ResidualView | None" = None


StructureDiagnosis: TypeAlias = Diagnosis[StructureDetails]
"""The diagnosis of a structure."""
