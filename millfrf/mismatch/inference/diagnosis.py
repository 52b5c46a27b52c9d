"""`Diagnosis`: accepted causes, the location of the mismatch, and errors on held-out data."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from millfrf.core import Result, Summary, doubts_line, drawing

from .settings import VerdictSettings

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Details = TypeVar("Details", covariant=True)

# "class": of a robot, equivalent causes
VERDICTS = ("none", "explained", "class", "partly explained", "unlisted", "unexplained")

NAMELESS = ("unlisted", "unexplained")  # verdicts on a difference for which no cause of the library is named


@dataclass(frozen=True)
class Remainder:
    """Part of a residual that is not noise."""

    # measure that decides whether the residual is noise. Structures and cuts: share of the residual power that is not
    # noise. Robots: excess cost divided by the number of deviations that the recordings determine
    share: float
    size: float  # the residual beyond noise in a unit common to all hypotheses, such as share of the response power

    def noise_like(self, most: float) -> bool:
        """Return whether the residual is taken for noise: its share is at most ``most``."""
        return self.share <= most


@dataclass(frozen=True)
class AcceptedCause:
    """Accepted cause with its numbers.

    Parameters
    ----------
    name
        Name of the physics, or ``modal_parameters``.
    location
        Place of the cause: ``{"channel": ...}``, ``{"direction": [...]}``, ``{"modes": [...]}`` or empty.
    parameters, standard_errors
        Numbers and their standard errors by name, in SI units.
    evidence
        Gain in score over the hypothesis without the cause (twice the logarithm of a Bayes factor).
    error_parts
        Known components of each standard error by the number's name: ``fit``, ``spread``, ``form``.
    """

    name: str
    location: Mapping[str, Any]
    parameters: Mapping[str, float]
    standard_errors: Mapping[str, float]
    evidence: float
    error_parts: Mapping[str, Mapping[str, float]] = field(default_factory=dict)


# stages of a candidate: tested without a fit, or fitted with numbers that are impossible
SCREENED, IMPOSSIBLE = "screened", "impossible"


@dataclass(frozen=True)
class Candidate:
    """Cause that was considered, accepted or not.

    Parameters
    ----------
    name
        Name of the physics.
    evidence
        Gain in score of the fit, or of the screening where it was not fitted.
    stage
        Last stage of the candidate: ``screened``, ``fitted``, or the reason of its rejection.
    location
        Place of the candidate, as in :class:`AcceptedCause`.
    parameters, standard_errors
        Numbers and their standard errors by name, where it was fitted.
    """

    name: str
    evidence: float
    stage: str
    location: Mapping[str, Any] = field(default_factory=dict)
    parameters: Mapping[str, float] = field(default_factory=dict)
    standard_errors: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class HeldOutError:
    """Errors on one held-out recording, relative to its root mean square response.

    ``before`` is the error of the nominal hypothesis, ``after`` that with causes, ``floor`` that of noise alone.
    """

    name: str
    before: float
    after: float
    floor: float


@dataclass(frozen=True)
class Improvement:
    """Errors on held-out data, relative to the root mean square response."""

    held_out: str
    # errors of the nominal hypothesis, of its believed numbers refitted alone, of the hypothesis with its causes
    before: float
    refitted: float
    after: float
    noise_floor: float  # root mean square of the noise
    # p-value of the improvement over the hypothesis named in ``against``: probability of it by chance, from a paired
    # test over blocks of a few seconds with each channel in units of its noise
    p_value: float
    interval: tuple[float, float]  # 95 % interval of ``after / before``
    # gain in misfit on held-out data over the refitted hypothesis, if all numbers are fitted to the other data; 0
    # without causes
    evidence: float = 0.0
    # compared hypothesis: ``refitted``; or ``nominal`` if only believed numbers changed, or if only the prior separates
    # the cause from refitted numbers
    against: str = "refitted"
    part: str = ""  # part of the recording that was held out, in words; empty if it was the whole recording, or none

    @property
    def where(self) -> str:
        """Held-out recording and part of it, in words."""
        return f"{self.held_out} {self.part}".rstrip()


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis(Result, Generic[Details]):
    """Result of a diagnosis of a structure, a robot or a cut.

    Parameters
    ----------
    compared
        Kind of comparison: ``structure``, ``robot`` or ``cut``.
    verdict
        ``none``, ``explained``, ``class``, ``partly explained`` (the causes help on held-out data, but leave more than
        a complete explanation may), ``unlisted`` (a force outside the library, whose free form predicts held-out data)
        or ``unexplained``.
    physics
        Accepted causes in the order of the search.
    candidates
        All causes that were considered, those with most evidence first.
    equivalents
        Names of causes that the data cannot distinguish from an accepted one.
    improvement
        Errors on held-out data.
    before, after
        Residual beyond noise without causes and with the reported causes.
    located
        Location of the mismatch: bands, channels, times, levels, orders.
    held_out
        Errors on each held-out recording, where several were held out in turn.
    doubts
        Warnings to be read with the verdict, one sentence each.
    content
        Additional content of the file for this kind of comparison, plain numbers and texts.
    details
        Fits and recordings of this kind of comparison; None if the diagnosis was read from a file.
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
        """Measure ``after.share`` of the final residual beyond noise."""
        return self.after.share

    def plot(self, axes: "Axes | None" = None) -> "Axes":
        """Draw the errors on held-out data and return the axes; see `draw_diagnosis`."""
        return drawing("draw_diagnosis")(self, axes)

    def _summary(self) -> Summary:
        gain = self.improvement
        error = f"error on {gain.where}: {100 * gain.before:.3g} % nominal, {100 * gain.after:.3g} % improved"
        causes = "; ".join(_name_and_place(cause) for cause in self.physics) or "no cause"
        if self.equivalents:
            causes += f" (cannot be distinguished from {', '.join(self.equivalents)})"
        rows = tuple(
            (cause.name, name, f"{value:.4g}", f"{cause.standard_errors.get(name, float('nan')):.2g}")
            for cause in self.physics
            for name, value in cause.parameters.items()
        )
        return Summary(
            f"Diagnosis of a {self.compared}: {self.verdict}",
            (causes, f"{error}, {100 * gain.noise_floor:.3g} % noise", *doubts_line(self.doubts)),
            ("cause", "parameter", "value", "standard error"),
            rows,
        )


def _name_and_place(cause: AcceptedCause) -> str:
    place = ", ".join(f"{key} {value}" for key, value in cause.location.items() if value != "")
    return f"{cause.name} ({place})" if place else cause.name


@dataclass(frozen=True)
class Findings:
    """Facts from which the verdict follows."""

    # residual beyond noise without causes and with them
    before: Remainder
    after: Remainder
    named: bool  # whether held-out data confirm at least one cause
    # whether no explanation is possible, because of a law beyond the limits of its name or a recording with chatter
    excluded: bool = False
    incomplete: bool = False  # whether the held-out data show that the explanation leaves more than it may
    halved: bool = True  # whether the causes remove the share of the held-out error that a partial explanation needs


def verdict_of(findings: Findings, settings: VerdictSettings) -> str:
    """Return the verdict: ``none``, ``explained``, ``partly explained`` or ``unexplained``.

    Examples
    --------
    >>> residuals = Remainder(0.3, 1.0), Remainder(0.01, 0.02)
    >>> verdict_of(Findings(*residuals, named=True), VerdictSettings())
    'explained'
    """
    if findings.excluded:
        return "unexplained"
    if not findings.named:
        complete = findings.before.noise_like(settings.noise_like) and not findings.incomplete
        return "none" if complete else "unexplained"
    quiet = findings.after.noise_like(settings.noise_like)
    little = quiet or findings.after.size <= (1 - settings.explained) * findings.before.size
    if little and not findings.incomplete:
        return "explained"
    less = little or findings.after.size <= (1 - settings.partly) * findings.before.size
    return "partly explained" if less and findings.halved else "unexplained"


def leaves_too_much(gain: Improvement, settings: VerdictSettings) -> bool:
    """Return whether the held-out error is too large for a complete explanation."""
    if gain.after > settings.most_of_response:
        return True
    return gain.after > settings.most_over_noise * gain.noise_floor and share_left(gain) > settings.most_left


def error_halved(gain: Improvement, settings: VerdictSettings) -> bool:
    """Return whether the held-out error is far enough below the rival's error for a partial explanation.

    The rival is the hypothesis named in ``gain.against``.
    """
    rival = gain.refitted if gain.against == "refitted" else gain.before
    excess, left = (max(error**2 - gain.noise_floor**2, 0.0) for error in (rival, gain.after))
    # an error as large as the response means that nothing is predicted, even if the rival is worse
    return gain.after < 1 and excess > 0 and left <= settings.halves * excess


def share_left(gain: Improvement) -> float:
    """Return the remaining share of the nominal model's held-out power above noise; above 1 if the error has grown.

    >>> share_left(Improvement("mid", 0.5, 0.4, 0.1, 0.1, 0.01, (0.1, 0.3)))
    0.0
    """
    excess = gain.before**2 - gain.noise_floor**2
    left = max(gain.after**2 - gain.noise_floor**2, 0.0)
    return left / excess if excess > 0 else float(left > 0)
