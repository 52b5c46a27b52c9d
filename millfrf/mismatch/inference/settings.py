"""`Settings`: every threshold of a decision, and `LabError`, the uncertainty of a laboratory's model."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from numbers import Integral
from numbers import Real as RealNumber
from typing import Any, ClassVar

from millfrf.core import InputError, Real

from .numerics import signed_ranks


@dataclass(frozen=True)
class LabError:
    """Standard deviation of the errors of a laboratory's modal fit.

    The defaults are choices of this project for a careful laboratory: frequencies agree to 1 %, damping ratios to about
    10 %, mode shapes to a few per cent. Round robins compare laboratories, but state no such figure (Balmes, GARTEUR
    group on ground vibration testing: results from the test of a single structure by 12 laboratories in Europe, IMAC
    XV, 1997). These numbers set what counts as a deviation, not how well anything is estimated.

    Parameters
    ----------
    frequency, damping
        Relative error of the natural frequency and of the damping ratio of a mode.
    shape
        Error of each real and imaginary part of a vector's entries, relative to the vector's root mean square.

    Raises
    ------
    InputError
        An error is not between 0 and 1.
    """

    frequency: float = 0.01
    damping: float = 0.12
    shape: float = 0.03

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not 0 < value < 1:
                raise InputError(f"LabError.{name} = {value!r} must be a share above 0 and below 1; 0.12 is 12 %")


@dataclass(frozen=True)
class Thresholds:
    """Record of thresholds: none is negative or NaN, counts are whole numbers, and shares lie between 0 and 1.

    A comparison with NaN is always false: a threshold of NaN would silently accept or reject everything.

    Examples
    --------
    >>> @dataclass(frozen=True)
    ... class Example(Thresholds, shares=["largest"]):
    ...     largest: float = 0.1
    >>> Example(5)
    Traceback (most recent call last):
    millfrf.core.errors.InputError: Example.largest = 5 must be a share from 0 to 1; 0.05 is 5 %
    """

    shares: ClassVar[frozenset[str]] = frozenset()

    def __init_subclass__(cls, shares: Sequence[str] = ()) -> None:
        cls.shares = cls.shares | set(shares)

    def __post_init__(self) -> None:
        for number in fields(self):
            if number.type in (int, float):
                self._check(number.name, getattr(self, number.name), number.type is int)

    def _check(self, name: str, value: Any, integer: bool) -> None:
        shown = f"{type(self).__name__}.{name} = {value!r}"
        if not isinstance(value, Integral if integer else RealNumber) or not float(value) >= 0:
            raise InputError(f"{shown} must be a {'whole ' if integer else ''}number that is not negative")
        if name in self.shares and float(value) > 1:
            raise InputError(f"{shown} must be a share from 0 to 1; 0.05 is 5 %")


@dataclass(frozen=True)
class EvidenceSettings(
    Thresholds,
    shares=(
        "as_good_form",
        "small",
        "small_after_linear",
        "small_after_law",
        "own",
        "small_in_part",
        "beside_fault",
        "nearer_nominal",
    ),
):
    """Evidence that a cause needs. Evidence is a gain in score: twice the logarithm of a Bayes factor.

    Parameters
    ----------
    least
        Evidence that every cause needs: 20 are odds of 20 000 to 1 (Kass & Raftery, Bayes Factors, J. Am. Stat.
        Assoc. 90, 1995, call 10 very strong).
    as_good
        Difference in evidence below which another cause is reported as equivalent: 10 is a likelihood ratio of 150.
    as_good_form
        Share of the evidence of a joint law that a second law must have to be reported as equivalent. No law has
        exactly the true form, and small differences in evidence may be due to the form.
    clear
        Number of standard errors by which a cause's number must differ from its value without the cause; chance alone
        exceeds 4 once in 16 000.
    unclear
        Factor on the necessary evidence if no number differs clearly. In one case with 6 % noise, a gain error that did
        not exist had an evidence of 26.
    small
        Share of the evidence of all earlier causes below which a further cause may only correct their form.
    small_after_linear
        This share after linear causes only, whose form is exact.
    small_after_law
        This share after a joint law, whose form is never exact.
    own
        Share of the evidence that a cause must keep if the laws have a free form. Such a cause corrects no form and
        needs only the share ``small``.
    small_in_part
        Share of all evidence below which a cause of a partial explanation is not reported, as it may only correct the
        other causes.
    beside_fault
        Share of the evidence of repaired faults below which a cause may only describe errors of the repair.
    stands_out
        Evidence that an added mode needs for each real number measured within its half-power band. It is 0.5 (ln 1.65)
        if the resonance is two thirds as strong as the noise there.
    nearer_nominal
        Share of the implausible deviation from the nominal model that a cause without gain in misfit must remove.
    farthest
        Largest plausible deviation of a mode's frequency if there is a joint law, in lab errors. With larger deviations
        any law can be made to fit.
    """

    least: float = 20.0
    as_good: float = 10.0
    as_good_form: float = 0.9
    clear: float = 4.0
    unclear: float = 5.0
    small: float = 0.01
    small_after_linear: float = 0.002
    small_after_law: float = 0.1
    own: float = 0.33
    small_in_part: float = 0.25
    beside_fault: float = 0.002
    stands_out: float = 0.5
    nearer_nominal: float = 0.6
    farthest: float = 50.0

    @property
    def large(self) -> float:
        """Evidence that a cause needs if no number differs clearly."""
        return self.unclear * self.least


@dataclass(frozen=True)
class SearchSettings(Thresholds, shares=("within_reach", "laws_again")):
    """Limits of the search for causes.

    Parameters
    ----------
    most_causes
        Largest number of accepted causes.
    most_tested
        Largest number of candidates of a round that are tested on held-out data, those with most evidence first.
    within_reach
        Least screened gain of a candidate that is fitted, as a share of the necessary evidence.
    laws_first
        Joint laws are fitted first if the screened gain of a law exceeds that of every linear cause by this factor.
    laws_again
        Share of the structured residual below which rejected joint laws are fitted again.
    levels_apart
        Least ratio of the strongest to the weakest level at which laws are also fitted level by level.
    most_work
        Work after which no further cause of a structure is searched for, in millions of values that fits compute
        (``Work``); the diagnosis then states this. Causes found before are still tested. The searches of robots and
        cuts have no such limit.
    """

    most_causes: int = 3
    most_tested: int = 4
    within_reach: float = 0.5
    laws_first: float = 100.0
    laws_again: float = 0.7
    levels_apart: float = 1.3
    most_work: float = 4000.0


@dataclass(frozen=True)
class ScreeningSettings(Thresholds, shares=("promising_law", "promising_linear", "nearly", "rival", "place")):
    """Which screened candidates are fitted.

    Parameters
    ----------
    promising_law, promising_linear
        Least screened gain of a law (or linear cause) that is fitted, as a share of the best law's (linear cause's).
    least_law
        Screened gain below which no law is fitted.
    most_laws, most_simulated, most_linear
        Number of laws fitted to the measured motion, of laws simulated freely, and of linear causes fitted.
    nearly, rival
        Least gain on the estimated motion of a law that is simulated, as a share of the best law's gain and of the best
        linear cause's gain.
    direction
        Least gain for each recording with which the location of a joint is accepted.
    place
        Share by which the gain of a joint away from the tip must exceed the gain of a joint at the tip.
    resolved
        Smallest half-power bandwidth of an added mode, in line spacings.
    """

    promising_law: float = 0.15
    promising_linear: float = 0.03
    least_law: float = 60.0
    most_laws: int = 4
    most_simulated: int = 2
    most_linear: int = 3
    nearly: float = 0.6
    rival: float = 0.3
    direction: float = 50.0
    place: float = 0.01
    resolved: float = 2.0


@dataclass(frozen=True)
class FaultSettings(Thresholds):
    """When a tone or a limited channel is a fault of the recording.

    Parameters
    ----------
    contrast
        Least ratio of the power of a tone in the residual to the median of its neighbourhood, summed over recordings.
        Noise of one response exceeds 15 in one recording once in 6000 lines, and 60 once in 10^10.
    seen_again
        Contrast that at least two recordings must show.
    forced, quiet_force
        Contrast of a force line from which the force is taken to cause the line, inside the compared band and above it.
    most_lines
        Largest number of tonal lines; more are a comb of periodic forces.
    most_tones
        Largest number of tones that are removed.
    most_varied
        Coefficient of variation of the amplitude over recordings above which a line is no extraneous tone, but may be
        caused by the forces.
    limit_gain
        Twice the gain in log likelihood that the limit of a channel needs.
    beyond, least_beyond
        Factor on the limit above which predicted samples count, and their smallest number.
    follows
        Slope of measured over predicted samples above which a limit is no clipping: an amplitude limited by friction or
        by a stiffening joint still rises with the prediction.
    """

    contrast: float = 60.0
    seen_again: float = 5.0
    forced: float = 12.0
    quiet_force: float = 5.0
    most_lines: int = 8
    most_tones: int = 4
    most_varied: float = 0.3
    limit_gain: float = 60.0
    beyond: float = 1.15
    least_beyond: int = 30
    follows: float = 0.1


FAULTS = FaultSettings()


@dataclass(frozen=True)
class ProofSettings(Thresholds, shares=("significance", "of_law", "belief_alone", "beaten", "halved")):
    """What held-out data must confirm.

    Parameters
    ----------
    gain
        Gain in misfit on held-out data that a cause needs: 10 is a likelihood ratio of 150.
    significance
        Largest p-value on held-out data of a reported cause.
    of_law
        The same of a structure's joint law, which is the best of several laws, places and forms that were tried.
    belief_alone
        Share of a cause's evidence below which its gain in misfit is insignificant: only the prior then separates it
        from refitted modes.
    beaten
        Ratio of held-out errors at or below which a cause replaces another.
    overwhelming, halved
        Least gain in misfit and largest ratio of the errors on held-out data with which a cause is kept regardless of
        the paired test: 1000 is a likelihood ratio of 10^217.
    test
        Paired test over blocks of time: p-value of the hypothesis that the second powers are not lower.
    """

    gain: float = 10.0
    significance: float = 0.05
    of_law: float = 0.01
    belief_alone: float = 0.05
    beaten: float = 0.25
    overwhelming: float = 1000.0
    halved: float = 0.5
    test: Callable[[Real, Real], float] = signed_ranks


@dataclass(frozen=True)
class VerdictSettings(Thresholds, shares=("explained", "partly", "halves")):
    """Residual that each verdict allows.

    Parameters
    ----------
    noise_like
        Largest :attr:`Remainder.share <millfrf.mismatch.inference.diagnosis.Remainder>` that passes for noise.
    explained
        Least share of the structured residual that a complete explanation removes if the final residual is not noise.
    partly
        Least share of the structured residual that a partial explanation removes; 1 allows no partial explanation.
    halves
        Share of the rival's held-out power above noise that a partial explanation may leave. The rival are refitted
        modes or the nominal model; a quarter of the power is half of the error.
    most_of_response
        Held-out error, as a share of the response, above which no explanation is complete.
    most_over_noise
        Ratio of held-out error to noise above which a cause may be missing.
    most_over_measured
        Ratio of held-out error to measured noise above which a cause is missing, regardless of the nominal model.
    most_left
        Share of the nominal model's power above noise that a complete explanation may leave if ``most_over_noise`` is
        exceeded.
    most_over_alone
        Ratio of the error in a recording to the error of modes refitted to this recording alone, above which the
        residual is not noise.
    most_not_noise
        Least size of such a residual, as a share of the response.
    most_over_free
        Ratio of the held-out error of a named law to that of its free form above which the named law is incomplete.
    another_structure
        Deviation of a pole, or root mean square deviation of a row or column of the mode shapes, in laboratory errors,
        above which refitted modes are another structure or another wiring and explain nothing: no modal test is wrong
        by ten of its standard deviations.
    """

    noise_like: float = 0.05
    explained: float = 0.95
    partly: float = 0.5
    halves: float = 0.25
    most_of_response: float = 0.25
    most_over_noise: float = 1.5
    most_over_measured: float = 5.0
    most_left: float = 0.1
    most_over_alone: float = 1.5
    most_not_noise: float = 0.1
    most_over_free: float = 2.0
    another_structure: float = 10.0


@dataclass(frozen=True)
class LocationSettings(Thresholds, shares=("family_wise", "least_spread")):
    """When a cell of frequency, time, channel or level holds a mismatch.

    Parameters
    ----------
    family_wise
        Probability that pure noise makes any cell of a diagnosis significant (Holm, Scand. J. Statistics 6, 1979).
    least_spread
        Smallest relative uncertainty of the noise level.
    quiet_level, quiet_spread
        Factor on the noise level of the quietest bands, which lie below the mean by chance, and its relative
        uncertainty, as these bands do not show the spectrum of the noise.
    seen
        Number of standard errors by which a recording's residual must exceed noise to count for the growth with level.
    levels_apart
        Least difference of the logarithms of the forces between recordings from which a growth is determined.
    """

    family_wise: float = 0.01
    least_spread: float = 0.02
    quiet_level: float = 1.25
    quiet_spread: float = 0.5
    seen: float = 2.0
    levels_apart: float = 0.1


LOCATION = LocationSettings()


@dataclass(frozen=True)
class Settings(Thresholds):
    """Uncertainty of the nominal model, causes and thresholds of a diagnosis.

    Parameters
    ----------
    lab
        Uncertainty of the laboratory's modal fit.
    causes
        Causes that are compared, by name; None takes all causes for this kind of comparison.
    evidence, search, screening, faults, proof, verdict, location
        Thresholds of each stage of the diagnosis.
    """

    lab: LabError = field(default_factory=LabError)
    causes: Mapping[str, Any] | None = None
    evidence: EvidenceSettings = field(default_factory=EvidenceSettings)
    search: SearchSettings = field(default_factory=SearchSettings)
    screening: ScreeningSettings = field(default_factory=ScreeningSettings)
    faults: FaultSettings = FAULTS
    proof: ProofSettings = field(default_factory=ProofSettings)
    verdict: VerdictSettings = field(default_factory=VerdictSettings)
    location: LocationSettings = LOCATION
