"""`Diagnosis`: what was found, where, how sure, and what it does to data that it was not fitted to."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from foundation import Result, Summary, doubts_line, drawing

from .remainder import Remainder

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Details = TypeVar("Details", covariant=True)

VERDICTS = ("none", "explained", "class", "partly explained", "unexplained")
"""All verdicts. ``class`` says of a robot that several causes explain as well as each other."""


@dataclass(frozen=True)
class AcceptedCause:
    """One accepted cause in plain numbers.

    Parameters
    ----------
    name
        Name of the physics, or ``modal_parameters``.
    location
        ``{"channel": ...}``, ``{"direction": [...]}``, ``{"modes": [...]}`` or empty.
    parameters, standard_errors
        Numbers and their standard errors by name, SI units.
    evidence
        Gain in score over the hypothesis without the cause (twice the logarithm of a Bayes factor).
    error_parts
        What a standard error is made of, by the number's name, where that is known: ``fit``, ``spread``, ``form``.
    """

    name: str
    location: Mapping[str, Any]
    parameters: Mapping[str, float]
    standard_errors: Mapping[str, float]
    evidence: float
    error_parts: Mapping[str, Mapping[str, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class Candidate:
    """A cause that was weighed.

    Parameters
    ----------
    name
        Name of the physics.
    evidence
        Gain in score, screened or fitted.
    stage
        How far it was taken: ``screened``, ``fitted``, or why it was not accepted.
    location
        Where it would sit.
    parameters, standard_errors
        Its numbers, where it was fitted and they are told.
    """

    name: str
    evidence: float
    stage: str
    location: Mapping[str, Any] = field(default_factory=dict)
    parameters: Mapping[str, float] = field(default_factory=dict)
    standard_errors: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class HeldOutError:
    """Errors on one recording that the fits did not see, relative to the root mean square response.

    Parameters
    ----------
    name
        Name of the recording.
    before, after
        Error of the nominal hypothesis and of the hypothesis with its causes.
    floor
        Error that noise alone leaves.
    """

    name: str
    before: float
    after: float
    floor: float


@dataclass(frozen=True)
class Improvement:
    """Error on data held out of the fits, relative to the root mean square response.

    Parameters
    ----------
    held_out
        Name of what was held out.
    before, refitted, after
        Errors of the nominal hypothesis, of its believed numbers refitted alone, of the hypothesis with its causes.
    noise_floor
        Root mean square noise there.
    p_value
        Probability that the improved hypothesis is no better than the one it is compared with (``against``), from
        blocks of a few seconds, every channel in units of its noise.
    interval
        95 % interval of ``after / before``.
    evidence
        Gain in misfit there over the refitted hypothesis, by numbers fitted to the other data; 0 where there are none.
    against
        ``refitted``, or ``nominal`` where nothing but believed numbers was found, or a cause that differs from a refit
        in the belief alone.
    part
        Which part of the recording was held out, in words; empty: all of it, or nothing.
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
    part: str = ""

    @property
    def where(self) -> str:
        """What was held out, in words."""
        return f"{self.held_out} {self.part}".rstrip()


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis(Result, Generic[Details]):
    """Everything that a diagnosis says, whatever was compared.

    Parameters
    ----------
    compared
        Kind of comparison: ``structure``, ``robot`` or ``cut``.
    verdict
        ``none``, ``explained``, ``class``, ``partly explained`` (the causes help on held-out data and leave more than
        their share) or ``unexplained``.
    physics
        Accepted causes in the order found.
    candidates
        All that were weighed, best first.
    equivalents
        Names that the data cannot tell from an accepted cause, none of them accepted itself.
    improvement
        Errors on held-out data.
    before, after
        What is left beyond noise, without causes and with those that are told.
    located
        Where the mismatch sits: bands, channels, times, levels, orders.
    held_out
        Errors on each recording that was held out, where several were in turn.
    doubts
        Sentences that a reader must see beside the verdict.
    content
        What the file says of this kind of comparison alone, plain numbers and texts.
    details
        Fits and recordings of this kind of comparison; None of a diagnosis that was read from a file.
    """

    compared: str
    verdict: str
    physics: tuple[AcceptedCause, ...]
    candidates: tuple[Candidate, ...]
    equivalents: tuple[str, ...]
    improvement: Improvement
    before: Remainder
    after: Remainder
    located: Mapping[str, Any]
    details: Details
    held_out: tuple[HeldOutError, ...] = ()
    doubts: tuple[str, ...] = ()
    content: Mapping[str, Any] = field(default_factory=dict)

    @property
    def leftover(self) -> float:
        """Share of the final residual that is no noise: ``Remainder.share`` of ``after``."""
        return self.after.share

    def plot(self, axes: "Axes | None" = None) -> "Axes":
        """Draw the errors on held-out data and return the axes; see :func:`figures.draw_diagnosis`."""
        return drawing("draw_diagnosis")(self, axes)

    def _summary(self) -> Summary:
        causes = [_cause_in_short(cause) for cause in self.physics]
        gain = self.improvement
        error = f"error on {gain.where}: {100 * gain.before:.3g} % nominal, {100 * gain.after:.3g} % improved"
        told = "; ".join(causes) or "no cause"
        if self.equivalents:
            told += f" (cannot be told from {', '.join(self.equivalents)})"
        rows = tuple(
            (cause.name, name, f"{value:.4g}", f"{cause.standard_errors.get(name, float('nan')):.2g}")
            for cause in self.physics
            for name, value in cause.parameters.items()
        )
        return Summary(
            f"Diagnosis of a {self.compared}: {self.verdict}",
            (told, f"{error}, {100 * gain.noise_floor:.3g} % noise", *doubts_line(self.doubts)),
            ("cause", "parameter", "value", "standard error"),
            rows,
        )


def _cause_in_short(cause: AcceptedCause) -> str:
    """Name of a cause with its place, where it has one."""
    place = ", ".join(f"{key} {value}" for key, value in cause.location.items() if value != "")
    return f"{cause.name} ({place})" if place else cause.name
