"""`StructureDetails`: what the diagnosis of a structure leaves for its maps, figures and reports."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

from estimation import WindowedSpectrum

from ..inference import Diagnosis
from ..models import Fit, Hypothesis
from ..records import ComparedBand

if TYPE_CHECKING:
    from .view_of_residual import ResidualView


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
    recordings: tuple[WindowedSpectrum, ...]
    measured: tuple[WindowedSpectrum, ...]
    elsewhere: tuple[Hypothesis, Hypothesis]
    band: ComparedBand
    view: "ResidualView | None" = None


StructureDiagnosis: TypeAlias = Diagnosis[StructureDetails]
"""The diagnosis of a structure."""
