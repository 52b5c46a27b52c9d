"""Was the cut stable? The verdict on a recording, from the lines that stand out of its noise."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

from .conclusion import concluded
from .evidence import gather_evidence
from .verdict import ChatterVerdict

Real = NDArray[np.float64]

FEWEST_REVOLUTIONS = 40


def classify_cut(
    samples: Real,
    sample_rate: float,
    spindle_speed: float,
    teeth: int,
    *,
    runout: bool = True,
    derivatives: Sequence[int] = (),
    natural_frequencies: Sequence[float] = (),
) -> ChatterVerdict:
    """Classify a cut at nearly constant speed from forces or vibration.

    The spindle is followed in the recording itself and all its orders are taken away: a stable cut repeats with every
    revolution. What is left is held against its own local noise floor. Chatter is modulated by the teeth: it has lines
    at ``+-f + k f_tooth``; a line without any is a foreign tone. Hopf chatter lies anywhere, period doubling at half
    the tooth passing (Insperger, Mann, Stepan & Bayly, Int. J. Mach. Tools Manuf. 43, 2003).

    Parameters
    ----------
    samples : (n_samples, n_channels)
        From the time the tool is fully in the cut.
    sample_rate
        Samples a second, Hz.
    spindle_speed
        rad/s, within 1 %; it may drift by 1 %.
    teeth
        Number of teeth.
    runout
        Whether teeth may cut unequal chips. With an even number of teeth runout has the lines of period doubling:
        where they do not grow, the verdict is then ``inconclusive`` instead of ``period-doubling``.
    derivatives : (n_channels,)
        2 for a channel of acceleration, 1 for velocity, 0 for displacement or force; empty: 0.
    natural_frequencies
        Of the structure, Hz. With them the line nearest to a mode gives the frequency; empty: that of largest motion.

    Raises
    ------
    InputError
        Fewer than 40 revolutions, samples that are not finite or all equal, or a speed that is not positive.
    """
    data = _checked(samples, sample_rate, spindle_speed, teeth)
    moving = data.std(axis=0) > 0
    evidence = gather_evidence(data[:, moving], sample_rate, spindle_speed, teeth)
    powers = tuple(derivatives) or (0,) * data.shape[1]
    kept = tuple(power for power, moves in zip(powers, moving, strict=True) if moves)
    verdict = concluded(evidence, runout, kept, tuple(natural_frequencies))
    speed = 2 * math.pi * evidence.track.mean_frequency
    return replace(verdict, spindle_speed=speed, drift=evidence.track.drift)


def _checked(samples: Real, sample_rate: float, spindle_speed: float, teeth: int) -> Real:
    data = np.asarray(samples, dtype=float)
    if not spindle_speed > 0 or teeth < 1:
        raise InputError(f"spindle speed {spindle_speed:g} rad/s and {teeth} teeth must be positive")
    turns = len(data) / sample_rate * spindle_speed / (2 * math.pi)
    if turns < FEWEST_REVOLUTIONS:
        raise InputError(
            f"{len(data) / sample_rate:.3g} s hold {turns:.0f} revolutions of the spindle; "
            f"{FEWEST_REVOLUTIONS} are needed: record longer"
        )
    if not np.isfinite(data).all():
        raise InputError(f"{int((~np.isfinite(data)).sum())} samples are not finite; leave the channel out")
    if not (data.std(axis=0) > 0).any():
        raise InputError("no channel holds any motion: all samples of each are equal; name others with --response")
    return data
