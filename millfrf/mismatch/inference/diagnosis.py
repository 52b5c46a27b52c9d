"""`Diagnosis`: what was found, where, with which confidence, and its effect on held-out data."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from millfrf.core import Result, Summary, doubts_line, drawing

from .settings import VerdictSettings

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True)
class Remainder:
    """What is left beyond noise.

    Parameters
    ----------
    share
        Measure that says by itself whether this is noise: of a structure and of a cut the share of the residual's power
        that is no noise, of a robot the excess cost for each deviation that the recordings tell.
    size
        The same in a unit that does not change between hypotheses, so that two remainders can be compared.
    """

    share: float
    size: float

    def noise_like(self, most: float) -> bool:
        """Whether it passes for noise: its share is at most ``most``."""
        return self.share <= most


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
        """Draw the errors on held-out data and return the axes; see `draw_diagnosis`."""
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


@dataclass(frozen=True)
class Findings:
    """What a verdict is made of.

    Parameters
    ----------
    before, after
        What is left without any cause, and with the causes.
    named
        Whether causes were found that the held-out data confirm.
    excluded
        Whether something rules out every answer: a law beyond what its name means, a recording that chatters.
    incomplete
        Whether the held-out data show that the answer leaves more than it may.
    halved
        Whether the causes remove the share of the held-out error that a partial answer needs.
    """

    before: Remainder
    after: Remainder
    named: bool
    excluded: bool = False
    incomplete: bool = False
    halved: bool = True


def verdict_of(found: Findings, settings: VerdictSettings) -> str:
    """The verdict: ``none``, ``explained``, ``partly explained`` or ``unexplained``.

    Parameters
    ----------
    found
        What is left, and what the held-out data say.
    settings
        Thresholds of what an answer may leave.

    Examples
    --------
    >>> left = Remainder(0.3, 1.0), Remainder(0.01, 0.02)
    >>> verdict_of(Findings(*left, named=True), VerdictSettings())
    'explained'
    >>> verdict_of(Findings(left[0], left[0], named=False), VerdictSettings())
    'unexplained'
    """
    if found.excluded:
        return "unexplained"
    if not found.named:
        complete = found.before.noise_like(settings.noise_like) and not found.incomplete
        return "none" if complete else "unexplained"
    quiet = found.after.noise_like(settings.noise_like)
    little = quiet or found.after.size <= (1 - settings.explained) * found.before.size
    if little and not found.incomplete:
        return "explained"
    less = little or found.after.size <= (1 - settings.partly) * found.before.size
    return "partly explained" if less and found.halved else "unexplained"


def leaves_too_much(gain: Improvement, settings: VerdictSettings) -> bool:
    """Whether an answer leaves more of the held-out recording than it may.

    Parameters
    ----------
    gain
        Errors on the recording held out.
    settings
        Thresholds of what an answer may leave.
    """
    if gain.after > settings.most_of_response:
        return True
    return gain.after > settings.most_over_noise * gain.noise_floor and share_left(gain) > settings.most_left


def error_halved(gain: Improvement, settings: VerdictSettings) -> bool:
    """Whether an answer leaves so little of what its rival leaves above the noise that it may be told in part.

    An answer that errs by as much as the response itself predicts nothing, whatever its rival does.

    Parameters
    ----------
    gain
        Errors on the recording held out.
    settings
        Thresholds of what an answer may leave.

    Examples
    --------
    >>> error_halved(Improvement("mid", 0.9, 0.5, 0.2, 0.1, 0.01, (0.1, 0.3)), VerdictSettings())
    True
    >>> error_halved(Improvement("mid", 0.9, 0.5, 0.3, 0.1, 0.01, (0.1, 0.3)), VerdictSettings())
    False
    """
    rival = gain.refitted if gain.against == "refitted" else gain.before
    excess, left = (max(one**2 - gain.noise_floor**2, 0.0) for one in (rival, gain.after))
    return gain.after < 1 and excess > 0 and left <= settings.halves * excess


def share_left(gain: Improvement) -> float:
    """Share of the nominal model's power above the noise, on the held-out recording, that the answer leaves.

    The share is 0 where nothing is left, and more than 1 where the answer is worse than the nominal model.

    Parameters
    ----------
    gain
        Errors on the recording held out.

    Examples
    --------
    >>> share_left(Improvement("mid", 0.5, 0.4, 0.1, 0.1, 0.01, (0.1, 0.3)))
    0.0
    """
    excess = gain.before**2 - gain.noise_floor**2
    left = max(gain.after**2 - gain.noise_floor**2, 0.0)
    return left / excess if excess > 0 else float(left > 0)
