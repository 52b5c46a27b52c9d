"""`Diagnosis`: what was found, where, how sure, and what it does to data that it was not fitted to."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimation import WindowedSpectrum

from ..models.fitting import Fit
from ..models.hypothesis import Explanation
from ..records.compared_band import ComparedBand

Real = NDArray[np.float64]

VERDICTS = ("none", "explained", "partly explained", "unexplained")


@dataclass(frozen=True)
class AcceptedCause:
    """One accepted cause in plain numbers.

    Parameters
    ----------
    name
        Of the physics, or ``modal_parameters``.
    location
        ``{"channel": ...}``, ``{"direction": [...]}``, ``{"modes": [...]}`` or empty.
    parameters, standard_errors
        By name, SI units.
    evidence
        Gain in score over the explanation without it (twice a log Bayes factor).
    """

    name: str
    location: dict[str, Any]
    parameters: dict[str, float]
    standard_errors: dict[str, float]
    evidence: float


@dataclass(frozen=True)
class Candidate:
    """A cause that was weighed, with its gain in score; how far it was taken (``screened`` or ``fitted``)."""

    name: str
    evidence: float
    stage: str
    location: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Improvement:
    """Error on a recording held out of the fits, relative to the root mean square response.

    Parameters
    ----------
    held_out
        Its name.
    before, refitted, after
        Of the nominal model, of the modal parameters refitted alone, of the improved model.
    noise_floor
        Root mean square noise there.
    p_value
        That the improved model is no better than the one it is compared with (``against``), from blocks of a few
        seconds, every channel in units of its noise.
    interval
        95 % interval of ``after / before``.
    evidence
        Gain in misfit there over the refitted model, by numbers fitted to the other recordings; 0 where there are none.
    against
        ``refitted``, or ``nominal`` where nothing but modal parameters was found, or a cause that differs from a refit
        in the lab's belief alone.
    """

    held_out: str
    before: float
    refitted: float
    after: float
    noise_floor: float
    p_value: float
    interval: tuple[float, float]
    evidence: float = 0.0
    against: str = "refitted"


@dataclass(frozen=True)
class Diagnosis:
    """Everything a report needs.

    Parameters
    ----------
    verdict
        ``none``, ``explained``, ``partly explained`` (the causes help on held-out data and leave more than their
        share) or ``unexplained``.
    physics
        Accepted causes in the order found.
    candidates
        All that were weighed, best first.
    equivalents
        Names that the data cannot tell from the first accepted cause.
    improvement
        On held-out data.
    leftover
        Share of the final residual's power that moves with the signal instead of staying as noise does.
    base, final
        Fits before and after.
    lines
        The recordings.
    elsewhere
        Modal parameters alone, and the final explanation, fitted without the recording held out.
    band
        In which model and recordings were compared, and why; None: not stated.
    doubts
        Sentences that a reader must see beside the verdict.
    measured
        The recordings with tones and clipping as they were measured; empty: as ``lines``.
    """

    verdict: str
    physics: tuple[AcceptedCause, ...]
    candidates: tuple[Candidate, ...]
    equivalents: tuple[str, ...]
    improvement: Improvement
    leftover: float
    base: Fit
    final: Fit
    lines: tuple[WindowedSpectrum, ...]
    elsewhere: tuple[Explanation, Explanation]
    located: dict[str, Any] = field(default_factory=dict)
    band: ComparedBand | None = None
    doubts: tuple[str, ...] = ()
    measured: tuple[WindowedSpectrum, ...] = ()
