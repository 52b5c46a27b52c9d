"""`ChatterVerdict`, the spectrum it was judged by, and what else is known of a cut."""

from dataclasses import dataclass

import numpy as np

from millfrf.core import Real

from .evidence import Evidence, ToolMotion
from .fitted_depth import ModelledCut

STABLE = "stable"
HOPF = "hopf"
DOUBLING = "period-doubling"
INCONCLUSIVE = "inconclusive"
CHATTER = (HOPF, DOUBLING)


@dataclass(frozen=True)
class ForeignTone:
    """A line that is neither an order of the spindle nor chatter.

    Parameters
    ----------
    frequency : Hz
        Frequency of the tone.
    share
        Root mean square of the tone over that of the motion, in the channel where it is largest.
    name
        Words for the tone's source, for example ``mains (3 x 50 Hz)``.
    """

    frequency: float
    share: float
    name: str


@dataclass(frozen=True)
class ChatterVerdict:
    """Verdict on a recording of a cut: stable or chattering, and why.

    Parameters
    ----------
    kind
        ``stable``, ``hopf``, ``period-doubling`` or ``inconclusive``.
    deviation
        Size of what does not repeat with the revolution over the size of the motion, in the second half: noise too.
    growth
        Size of the strongest line that is not foreign in the last eighth over that in the first; NaN without such a
        line.
    frequency : Hz
        Frequency of the line with the largest motion, not folded; NaN if the cut does not chatter.
    p_value
        Probability that the recording's own noise has a line as strong as the strongest that is not foreign; 1 if
        there is none.
    share
        Root mean square of the lines of chatter over that of the motion, in the channel where it is largest.
    foreign
        Tones that are neither the spindle's nor chatter.
    spindle_speed : rad/s
        Spindle speed found from the recording.
    drift
        Change of the spindle's speed from beginning to end, over its mean.
    reason
        One sentence that says why the verdict is as it is.
    warnings
        Doubts, one sentence each.
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


@dataclass(frozen=True)
class Knowledge:
    """Facts about a cut that are known beside its recording.

    Parameters
    ----------
    runout
        Radial offset of the spindle's axis, m; 0: equal teeth, NaN: not stated, infinite: whatever it takes.
    derivatives : (n_channels,)
        2 for acceleration, 1 for velocity, 0 for displacement or force, of the evidence's channels.
    natural
        Natural frequencies, Hz; empty: not known.
    motion
        Channels of the tool and the chip; None: not known.
    modelled
        Cutter and structure at the tip, channels being the evidence's; None: not known.
    """

    runout: float
    derivatives: tuple[int, ...]
    natural: tuple[float, ...] = ()
    motion: ToolMotion | None = None
    modelled: ModelledCut | None = None


MOST_POINTS = 1500
"""Points of a stored spectrum; each is the largest of the lines that it stands for."""


@dataclass(frozen=True)
class CutSpectrum:
    """Spectrum of one channel in the second half of a recording, with the orders of the spindle apart.

    Parameters
    ----------
    channel
        Number of the channel among those that were judged.
    frequencies : (n_points,), Hz
        Frequencies of the points, increasing.
    amplitude : (n_points,)
        Root mean square of what does not repeat with the revolution, a line of resolution, in the unit of the samples;
        the largest within a point. NaN where an order of the spindle hides it.
    floor : (n_points,)
        Root mean square of the noise floor, a line of resolution, in the unit of the samples.
    order_frequencies, order_amplitudes : (n_orders,)
        Frequencies (Hz) and root mean squares of the orders of the spindle that were taken away.
    """

    channel: int
    frequencies: Real
    amplitude: Real
    floor: Real
    order_frequencies: Real
    order_amplitudes: Real


def cut_spectrum(evidence: Evidence, highest: float) -> CutSpectrum:
    """Give the spectrum of the channel in which lines stand out most, up to a frequency.

    Parameters
    ----------
    evidence
        Evidence of the recording, from :func:`gather_evidence`.
    highest : Hz
        Highest frequency to show; no more than was searched is shown.
    """
    spectrum, spindle = evidence.spectrum, evidence.track.mean_frequency
    channel = _channel(evidence)
    scale = float(evidence.scales[channel])
    searched = spectrum.searched
    top = min(highest, float(spectrum.orders[searched][-1]) * spindle)
    shown = spectrum.orders * spindle <= top
    left = np.where(searched, spectrum.power[:, channel], np.nan)[shown]
    power, middles = _largest(left), _largest(spectrum.orders[shown] * spindle)
    floor = _largest(spectrum.floor[shown, channel])
    turn = evidence.late.mean_turn[:, channel]
    orders = np.asarray(np.sqrt(2) * np.abs(np.fft.rfft(turn)) / len(turn), dtype=float)
    places = np.arange(len(orders), dtype=float) * spindle
    kept = (places > 0) & (places <= top)
    return CutSpectrum(
        channel, middles, scale * np.sqrt(power), scale * np.sqrt(floor), places[kept], scale * orders[kept]
    )


def _channel(evidence: Evidence) -> int:
    """Choose the channel in which the strongest line has its largest share; without lines, where least repeats."""
    if evidence.families:
        return int(np.argmax(evidence.families[0].lines[0].amplitude / evidence.late.size))
    return int(np.argmax(evidence.late.residual.std(axis=0) / evidence.late.size))


def _largest(values: Real) -> Real:
    """Give at most `MOST_POINTS` points, each the largest of equally many neighbours; NaN where all are."""
    each = -(-len(values) // MOST_POINTS)
    padded = np.concatenate([values, np.full(-len(values) % each, np.nan)]).reshape(-1, each)
    largest = np.where(np.isnan(padded), -np.inf, padded).max(axis=1)
    return np.where(np.isfinite(largest), largest, np.nan)
