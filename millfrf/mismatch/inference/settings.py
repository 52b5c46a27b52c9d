"""`Settings`: every threshold of a decision, and `LabError`, the uncertainty of a laboratory's model."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from numbers import Integral
from numbers import Real as RealNumber
from typing import Any, ClassVar

from millfrf.core import InputError, Real

from .paired_tests import signed_ranks


@dataclass(frozen=True)
class LabError:
    """One standard deviation of what a laboratory's modal fit is usually off.

    The defaults are choices of this project for a careful laboratory: frequencies agree to a per cent, dampings to some
    ten, shapes to a few. Round robins compare laboratories, and state no such figure (Balmes, GARTEUR group on ground
    vibration testing: results from the test of a single structure by 12 laboratories in Europe, IMAC XV, 1997). They
    set what counts as a deviation, not how well anything is estimated.

    Parameters
    ----------
    frequency, damping
        Relative error of a mode's natural frequency and of its damping ratio.
    shape
        Error of each real and imaginary part of a vector's entries, relative to the vector's root mean square.

    Raises
    ------
    InputError
        An error that is no share above 0 and below 1.
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
    """Numbers that decide something: none is negative or NaN, counts are whole, and shares lie from 0 to 1.

    A comparison with NaN is always false. Such a threshold would let everything pass, or nothing, in silence.

    Raises
    ------
    InputError
        A field that is no such number; the message names it with its value.

    Examples
    --------
    >>> @dataclass(frozen=True)
    ... class Doubt(Thresholds, shares=["most"]):
    ...     most: float = 0.1
    >>> Doubt(5)
    Traceback (most recent call last):
    millfrf.core.errors.InputError: Doubt.most = 5 must be a share from 0 to 1; 0.05 is 5 %
    """

    shares: ClassVar[frozenset[str]] = frozenset()

    def __init_subclass__(cls, shares: Sequence[str] = ()) -> None:
        cls.shares = cls.shares | set(shares)

    def __post_init__(self) -> None:
        for one in fields(self):
            if one.type in (int, float):
                self._check(one.name, getattr(self, one.name), one.type is int)

    def _check(self, name: str, value: Any, whole: bool) -> None:
        said = f"{type(self).__name__}.{name} = {value!r}"
        if not isinstance(value, Integral if whole else RealNumber) or not float(value) >= 0:
            raise InputError(f"{said} must be a {'whole ' if whole else ''}number that is not negative")
        if name in self.shares and float(value) > 1:
            raise InputError(f"{said} must be a share from 0 to 1; 0.05 is 5 %")


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
        "mends_belief",
    ),
):
    """When a cause gains enough where it is fitted. Gains are in score: twice the logarithm of a Bayes factor.

    Parameters
    ----------
    least
        Gain below which nothing is accepted: 20 are odds of some twenty thousand to one (Kass & Raftery, Bayes
        Factors, J. Am. Stat. Assoc. 90, 1995, call 10 very strong).
    as_good
        Gain by which another cause may be worse and is still told as equivalent: 10 is a likelihood ratio of 150, and
        6 one of 20 (from there Kass & Raftery call evidence very strong, and strong).
    as_good_form
        Share of the evidence of a joint's law from which another law is told as equivalent: their forms are never quite
        the true ones, and so small a difference is one of form.
    clear
        Standard errors by which a number of a cause must differ from its value without the cause; chance alone exceeds
        4 once in 16 000.
    unclear
        Factor on the evidence that a cause needs whose number does not stand out of its error: a case with 6 % noise
        had named a gain error with an evidence of 26.
    small
        Share of the evidence found so far below which a further cause may only mend the form of the first.
    small_after_linear
        The same share while only linear causes are accepted: a mode or a gain has one form, and leaves nothing but
        what its numbers lack to their best.
    small_after_law
        The same share once a joint's law is accepted, whose form is never quite the true one.
    own
        Share of its gain that a cause must keep while the forms of laws are free, to need no more than ``small`` after
        one: it then mends no form.
    small_in_part
        Share of the evidence of all causes below which one is not told where the answer is partial: it may mend what is
        left of the others.
    beside_fault
        Share of the evidence of mended faults below which a cause may only mend what their mending leaves.
    stands_out
        Evidence that a further mode needs for each real number measured within its half-power band: 0.5 where its
        resonance explains two thirds of the noise's power there (0.5 = ln 1.65).
    mends_belief
        Share of the odd deviation from the laboratory's model that a cause must remove when it gains no misfit.
    farthest
        Errors of a laboratory by which a joint's law may ask a mode's frequency to be off: farther off lies another
        structure, whose modes bend to any law.
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
    mends_belief: float = 0.6
    farthest: float = 50.0


@dataclass(frozen=True)
class SearchSettings(Thresholds, shares=("within_reach", "laws_again")):
    """How far the search for causes goes.

    Parameters
    ----------
    most_causes
        Causes accepted at most.
    most_tested
        Candidates of a round with enough evidence, best first, that are tested on data held out.
    within_reach
        Screened gain, as a share of the evidence that is needed, from which a candidate is fitted.
    laws_first
        Factor of a joint law's screened gain over any linear cause's from which laws are fitted first.
    laws_again
        Share of what moved with the signal when joint laws failed, below which they are tried again.
    levels_apart
        Factor between the weakest and the strongest recording from which laws are carried from one to the other.
    longest
        Time after which no further cause of a structure's mismatch is looked for, s; the answer says so. What was
        found is judged all the same. Robots and cuts are searched to the end.
    """

    most_causes: int = 3
    most_tested: int = 4
    within_reach: float = 0.5
    laws_first: float = 100.0
    laws_again: float = 0.7
    levels_apart: float = 1.3
    longest: float = 120.0


@dataclass(frozen=True)
class ScreeningSettings(Thresholds, shares=("promising_law", "promising_linear", "nearly", "rival", "place")):
    """Which screened candidates are fitted.

    Parameters
    ----------
    promising_law, promising_linear
        Screened gain, as a share of the best law's and of the best linear cause's, from which one is fitted.
    least_law
        Screened gain below which no law is fitted.
    most_laws, most_simulated, most_linear
        Laws fitted to the motion seen; the best of them that are simulated freely; linear causes fitted.
    nearly, rival
        Gain of a law on the motion seen, as a share of the best law's and of the best linear cause's, from which it
        is simulated.
    direction
        Gain for each recording from which the place of a joint is believed.
    place
        Share by which a joint between points or in the modes must explain more than one at the tip.
    resolved
        Least half-power bandwidth of an added mode, in spacings of lines.
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
    """When a tone or a limit is a fault of the recording.

    Parameters
    ----------
    contrast
        Power of a residual line over the median of its neighbourhood, summed over recordings, from which it is a tone.
        Noise of one response passes 15 in one recording once in 6000 lines, and 60 once in 10^10.
    seen_again
        Contrast that two recordings must show at least.
    forced, quiet_force
        Contrast of a force, in the compared band and above it, from which a line is the cut's own.
    most_lines
        Lines that may stand out as tones; more are a comb, as forces that repeat make it.
    most_tones
        Tones taken out at most.
    most_varied
        Standard deviation of an amplitude over recordings, over its mean, above which it is no tone from elsewhere:
        what follows the forces varies as they do.
    limit_gain
        Twice the logarithm of the likelihood that a limit of a channel must gain.
    beyond, least_beyond
        Factor on a limit beyond which a predicted sample must show it, and how many such samples are needed.
    follows
        Slope of what is shown on what was predicted beyond a limit, above which it is no limit: an amplitude that
        friction or a stiffening joint keeps small still rises with its prediction.
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
"""The usual thresholds."""


@dataclass(frozen=True)
class ProofSettings(Thresholds, shares=("significance", "belief_alone", "beaten", "halved")):
    """What data that no fit has seen must confirm.

    Parameters
    ----------
    gain
        Gain in misfit on the data held out below which a cause is let go: 10 is a likelihood ratio of 150.
    significance
        p-value on the data held out above which a cause is not told.
    belief_alone
        Share of a cause's evidence below which its misfit says nothing, as the belief alone tells it from a refit.
    beaten
        Share of another cause's error held out, at or below which a cause takes its place.
    overwhelming, halved
        Gain in misfit on the data held out, and share of the error there without a cause, from which on and down to
        which the cause is kept whatever the test over blocks says: 1000 is a likelihood ratio of 10^217.
    test
        Paired test over blocks of time: p-value that the second powers are not below the first.
    """

    gain: float = 10.0
    significance: float = 0.05
    belief_alone: float = 0.05
    beaten: float = 0.25
    overwhelming: float = 1000.0
    halved: float = 0.5
    test: Callable[[Real, Real], float] = signed_ranks


@dataclass(frozen=True)
class VerdictSettings(Thresholds, shares=("explained", "partly", "halves")):
    """What an answer may leave.

    Parameters
    ----------
    noise_like
        Measure of what is left (see :class:`~millfrf.mismatch.inference.diagnosis.Remainder`) up to which it passes
        for noise.
    explained
        Share of what the hypothesis without causes leaves that causes must remove, if the rest is not noise-like.
    partly
        Share that they must remove to be told at all; 1 tells nothing.
    halves
        Share of the held-out power above the noise that a partial answer may leave of what it is compared with,
        refitted modes or the nominal model: a quarter of the power is half of the error.
    most_of_response
        Error held out, as a share of the response, above which no answer is complete.
    most_over_noise
        Error held out over the noise above which something may still be missing.
    most_over_measured
        Error held out over noise that was measured above which something is missing, whatever the nominal model leaves.
    most_left
        Share of the nominal model's power above the noise that an answer may then leave.
    most_over_alone
        Error in any recording over that of modes that are refitted to it alone, above which what is left is no noise.
    most_not_noise
        Share of the response that must so be known to be no noise.
    most_over_free
        Error held out over that of the same law in a free form, above which the law's name is not the whole.
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


@dataclass(frozen=True)
class LocationSettings(Thresholds, shares=("family_wise", "least_spread")):
    """Where a mismatch is said to sit.

    Parameters
    ----------
    family_wise
        Probability that any cell of a diagnosis is called significant where only noise is left (Holm, Scand. J.
        Statistics 6, 1979).
    least_spread
        Least relative uncertainty of the noise level, which is never known better than to two per cent.
    quiet_level, quiet_spread
        Level and spread of a noise read from the quietest bands, which lie below the mean by chance and hide its
        colour; no noise is taken to be known worse.
    seen
        Standard errors above noise from which a recording's residual counts in its growth with the level.
    levels_apart
        Difference of the logarithms of the forces from which recordings show a growth.
    """

    family_wise: float = 0.01
    least_spread: float = 0.02
    quiet_level: float = 1.25
    quiet_spread: float = 0.5
    seen: float = 2.0
    levels_apart: float = 0.1


LOCATION = LocationSettings()
"""The usual thresholds of locating."""


@dataclass(frozen=True)
class Settings(Thresholds):
    """How a diagnosis is made.

    Parameters
    ----------
    lab
        What the believed model is usually off.
    causes
        Causes that are weighed, by name; None: the whole library of the kind of comparison.
    evidence, search, screening, faults, proof, verdict, location
        Thresholds of each step.
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
