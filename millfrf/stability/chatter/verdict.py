"""`ChatterVerdict`: the state of a recorded cut; its spectrum at stated orders; recorded cuts and their files."""

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from millfrf.core import FileFormatError, Real, read_json, write_json

from ..settings import THRESHOLDS
from .evidence import Evidence, ToolMotion
from .fitted_depth import ModelledCut

STABLE = "stable"
HOPF = "hopf"
DOUBLING = "period-doubling"
INCONCLUSIVE = "inconclusive"
CHATTER = (HOPF, DOUBLING)


@dataclass(frozen=True)
class ForeignTone:
    """A line that is neither an order of the spindle nor chatter."""

    frequency: float  # Hz
    share: float  # root mean square over root mean square of the motion, in the channel where it is largest
    name: str  # source of the tone, for example ``mains (3 x 50 Hz)``


@dataclass(frozen=True)
class ChatterVerdict:
    """Verdict on a recording of a cut: stable or chattering, and why.

    Parameters
    ----------
    kind
        ``stable``, ``hopf``, ``period-doubling`` or ``inconclusive``.
    deviation
        Size of the motion that does not repeat with the revolution over the size of all motion, in the second half of
        the recording; noise is included.
    growth
        Size of the strongest line that is not foreign, in the last eighth of the recording over the first eighth; NaN
        without such a line.
    frequency : Hz
        Frequency of the line with the largest motion, not folded; NaN if the cut does not chatter.
    p_value
        Probability that the noise of the recording has a line as strong as the strongest line that is not foreign; 1
        without such a line.
    share
        Root mean square of the lines of chatter over the root mean square of the motion, in the channel where this
        ratio is largest.
    foreign
        Tones that are neither orders of the spindle nor chatter.
    spindle_speed : rad/s
        Spindle speed found from the recording; NaN where none is.
    drift
        Change of the spindle's speed from beginning to end, over its mean.
    reason
        Reason for the verdict, one sentence.
    warnings
        Warnings, one sentence each.
    side_line : Hz
        Frequency of another line that may be the chatter's own, so that ``frequency`` is a side line; NaN: none.
    """

    kind: str
    deviation: float
    growth: float
    frequency: float
    p_value: float = 1.0
    share: float = 0.0
    foreign: tuple[ForeignTone, ...] = ()
    spindle_speed: float = float("nan")
    drift: float = 0.0
    reason: str = ""
    warnings: tuple[str, ...] = ()
    side_line: float = float("nan")

    @property
    def in_words(self) -> str:
        """Return kind and frequency."""
        return self.kind + ("" if math.isnan(self.frequency) else f" at {self.frequency:.4g} Hz")


@dataclass(frozen=True)
class Knowledge:
    """Facts about a cut that do not come from its recording."""

    runout: float  # m, radial offset of the spindle's axis; 0: equal teeth, infinite: of any size
    derivatives: tuple[int, ...]  # per channel of the evidence: 2 acceleration, 1 velocity, 0 displacement or force
    natural: tuple[float, ...] = ()  # natural frequencies, Hz; empty: not known
    motion: ToolMotion | None = None  # channels of the tool and the chip; None: not known
    modelled: ModelledCut | None = None  # with channel numbers of the evidence; None: not known
    only_stated: bool = False  # whether nothing measured the speed


@dataclass(frozen=True)
class CutSpectrum:
    """Spectrum of one channel in the second half of a recording; orders of the spindle are kept separately.

    Parameters
    ----------
    channel
        Number of the channel among those that were judged.
    frequencies : (n_points,), Hz
        Frequencies of the points, increasing.
    amplitude : (n_points,)
        Root mean square of the motion that does not repeat with the revolution, per line of resolution, in the unit of
        the samples; the largest within a point. NaN where an order of the spindle hides it.
    floor : (n_points,)
        Root mean square of the noise floor per line of resolution, in the unit of the samples.
    order_frequencies, order_amplitudes : (n_orders,)
        Frequencies (Hz) and root mean squares of the spindle orders that were subtracted.
    """

    channel: int
    frequencies: Real
    amplitude: Real
    floor: Real
    order_frequencies: Real
    order_amplitudes: Real


def cut_spectrum(evidence: Evidence, highest: float) -> CutSpectrum:
    """Return the spectrum of the channel with the most significant lines, up to a frequency.

    Parameters
    ----------
    evidence
        Evidence of the recording, from :func:`gather_evidence`.
    highest : Hz
        Highest frequency to show, limited to the frequencies that were searched.
    """
    spectrum, spindle = evidence.spectrum, evidence.track.mean_frequency
    # the channel in which the strongest line has its largest share; without lines, the one that repeats least
    if evidence.families:
        channel = int(np.argmax(evidence.families[0].lines[0].amplitude / evidence.late.size))
    else:
        channel = int(np.argmax(evidence.late.residual.std(axis=0) / evidence.late.size))
    scale = float(evidence.scales[channel])
    searched = spectrum.searched
    top = min(highest, float(spectrum.orders[searched][-1]) * spindle)
    shown = spectrum.orders * spindle <= top
    power = _largest(np.where(searched, spectrum.power[:, channel], np.nan)[shown])
    frequencies = _largest(spectrum.orders[shown] * spindle)
    floor = _largest(spectrum.floor[shown, channel])
    turn = evidence.late.mean_turn[:, channel]
    orders = np.asarray(np.sqrt(2) * np.abs(np.fft.rfft(turn)) / len(turn), dtype=float)
    order_frequencies = np.arange(len(orders), dtype=float) * spindle
    in_range = (order_frequencies > 0) & (order_frequencies <= top)
    return CutSpectrum(
        channel,
        frequencies,
        scale * np.sqrt(power),
        scale * np.sqrt(floor),
        order_frequencies[in_range],
        scale * orders[in_range],
    )


def _largest(values: Real) -> Real:
    """Reduce to at most 1500 points, each the largest of equally many neighbours; NaN where all of them are NaN."""
    group = -(-len(values) // 1500)
    padded = np.concatenate([values, np.full(-len(values) % group, np.nan)]).reshape(-1, group)
    largest = np.where(np.isnan(padded), -np.inf, padded).max(axis=1)
    return np.where(np.isfinite(largest), largest, np.nan)


FORMAT = "millfrf.chatter"
FORMAT_VERSION = 1
_ARRAYS = ("frequencies", "amplitude", "floor", "order_frequencies", "order_amplitudes")  # of a spectrum
_NUMBERS = ("deviation", "growth", "frequency", "p_value", "share", "spindle_speed", "drift")  # of a verdict


@dataclass(frozen=True)
class JudgedCut:
    """A recording of a cut, with its verdict."""

    name: str  # of the recording's file
    stated_rpm: float  # spindle speed that the recording or the user states
    verdict: ChatterVerdict

    @property
    def rpm(self) -> float:
        """Return the spindle speed that the recording shows; the stated one where it shows none."""
        measured = self.verdict.spindle_speed * 30 / math.pi
        return measured if math.isfinite(measured) else self.stated_rpm

    def proposed_rpm(self, teeth: int) -> tuple[float, ...]:
        """Return the speeds next to that of a chattering cut at which teeth pass in step with the chatter.

        At ``60 f / (k teeth)`` rpm, with the frequency f of the chatter and a whole number k, each tooth meets the wave
        of the last one in phase: there a stability lobe has its peak (Altintas, Manufacturing Automation, 2nd ed.,
        section 4.4), if f is near a mode of the structure. Empty without chatter, and where f may be a side line, whose
        speeds would be others.
        """
        if self.verdict.kind not in CHATTER or not math.isfinite(self.verdict.frequency) or self.own_line_is_open:
            return ()
        waves = self.verdict.frequency / (teeth * self.rpm / 60)
        numbers = {math.floor(waves), math.ceil(waves)} - {0}
        return tuple(sorted(60 * self.verdict.frequency / (number * teeth) for number in numbers))

    @property
    def own_line_is_open(self) -> bool:
        """Check whether the frequency may be that of a side line."""
        return math.isfinite(self.verdict.side_line) and math.isfinite(self.verdict.frequency)

    @property
    def doubts(self) -> tuple[str, ...]:
        """Return the warnings about the verdict and, if it is inconclusive, the reason; one sentence each."""
        warnings = self.verdict.warnings
        if self.own_line_is_open:
            warnings = (
                *warnings,
                f"{self.verdict.frequency:.4g} or {self.verdict.side_line:.4g} Hz is the frequency of the chatter, the "
                "other a side line: no speed is proposed; give --model, or the motion of the tip and a cutting file "
                "with feed_per_tooth_m",
            )
        if self.verdict.kind == "inconclusive":
            warnings = (f"inconclusive: {self.verdict.reason}", *warnings)
        decided = self.verdict.kind != "inconclusive"  # otherwise the orders may be those of another speed
        if decided and abs(self.rpm / self.stated_rpm - 1) > THRESHOLDS.reported_speed_error:
            warnings = (
                *warnings,
                f"the spindle turned at {self.rpm:.1f} rpm, stated are {self.stated_rpm:.1f} rpm",
            )
        return tuple(f"{self.name}: {warning}" for warning in warnings)


@dataclass(frozen=True)
class KeptCut:
    """A verdict and the spectrum of the channel that shows it best."""

    cut: JudgedCut
    channel: str  # name of the channel of the spectrum
    unit: str  # of the spectrum
    spectrum: CutSpectrum


def write_cuts(path: str | os.PathLike[str], cuts: Sequence[KeptCut], provenance: Mapping[str, Any]) -> None:
    """Write verdicts and spectra to a JSON file; a number that is not known is ``null``.

    Raises
    ------
    InputError
        The folder cannot be written to.
    """
    content = {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "cuts": [_stored(cut) for cut in cuts],
        "provenance": dict(provenance),
    }
    write_json(path, content)


def read_cuts(path: str | os.PathLike[str]) -> tuple[KeptCut, ...]:
    """Read a file that :func:`write_cuts` wrote.

    Raises
    ------
    FileFormatError
        Another format or version, or missing fields.
    """
    name = Path(path).name
    content = read_json(path, "verdicts made by chatter")
    try:
        if (content["format"], content["format_version"]) != (FORMAT, FORMAT_VERSION):
            raise FileFormatError(
                f"{name} is {content['format']!r} version {content['format_version']!r}, expected {FORMAT!r} version "
                f"{FORMAT_VERSION}; run millfrf chatter again"
            )
        return tuple(_read(cut) for cut in content["cuts"])
    except (KeyError, TypeError, ValueError) as error:
        raise FileFormatError(
            f"{name} holds no verdicts on cuts; run millfrf chatter ... --out {name} again"
        ) from error


def _stored(kept_cut: KeptCut) -> dict[str, Any]:
    verdict, spectrum = kept_cut.cut.verdict, kept_cut.spectrum
    return {
        "recording": kept_cut.cut.name,
        "stated_speed_rpm": kept_cut.cut.stated_rpm,
        "verdict": verdict.kind,
        "reason": verdict.reason,
        "warnings": list(verdict.warnings),
        **{name: _or_null(getattr(verdict, name)) for name in (*_NUMBERS, "side_line")},
        "foreign_tones": [
            {"frequency": tone.frequency, "share": tone.share, "name": tone.name} for tone in verdict.foreign
        ],
        "spectrum": {
            "channel": kept_cut.channel,
            "number": spectrum.channel,
            "unit": kept_cut.unit,
            **{name: [_or_null(float(f"{value:.5g}")) for value in getattr(spectrum, name)] for name in _ARRAYS},
        },
    }


def _read(stored: Mapping[str, Any]) -> KeptCut:
    verdict = ChatterVerdict(
        kind=str(stored["verdict"]),
        foreign=tuple(ForeignTone(tone["frequency"], tone["share"], tone["name"]) for tone in stored["foreign_tones"]),
        reason=str(stored["reason"]),
        warnings=tuple(str(warning) for warning in stored["warnings"]),
        side_line=_or_nan(stored.get("side_line")),  # files of earlier versions have none
        **{name: _or_nan(stored[name]) for name in _NUMBERS},
    )
    spectrum = stored["spectrum"]
    arrays = {name: np.array([_or_nan(value) for value in spectrum[name]]) for name in _ARRAYS}
    lengths = [len(arrays[name]) for name in _ARRAYS]
    if len(set(lengths[:3])) != 1 or lengths[3] != lengths[4]:
        raise ValueError("a spectrum's columns differ in length")
    cut = JudgedCut(str(stored["recording"]), float(stored["stated_speed_rpm"]), verdict)
    return KeptCut(cut, str(spectrum["channel"]), str(spectrum["unit"]), CutSpectrum(int(spectrum["number"]), **arrays))


def _or_null(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _or_nan(value: float | None) -> float:
    return math.nan if value is None else float(value)
