"""Was the cut stable? The verdict on a recording, from the lines that stand out of its noise."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

from .conclusion import concluded
from .fitted_depth import ModelledCut
from .knowledge import Knowledge
from .motion import ToolMotion, gather_evidence
from .verdict import ChatterVerdict

Real = NDArray[np.float64]

FEWEST_REVOLUTIONS = 40


def classify_cut(
    samples: Real,
    sample_rate: float,
    spindle_speed: float,
    teeth: int,
    *,
    runout: float = math.inf,
    derivatives: Sequence[int] = (),
    natural_frequencies: Sequence[float] = (),
    chip: float = math.nan,
    tool: Sequence[int] = (),
    modelled: ModelledCut | None = None,
) -> ChatterVerdict:
    """Classify a cut at nearly constant speed from forces or vibration.

    The spindle is followed in the recording itself and all its orders are taken away: a stable cut repeats with every
    revolution. What is left is held against its own local noise floor. Chatter is modulated by the teeth: it has lines
    at ``+-f + k f_tooth``; a line without any is a foreign tone. Hopf chatter lies anywhere, period doubling at half
    the tooth passing (Insperger, Mann, Stepan & Bayly, Int. J. Mach. Tools Manuf. 43, 2003). Where the chip is known,
    a vibration that changes it more, and more steadily, than the noise of a stable cut can is chatter however small its
    share of the motion is.

    Parameters
    ----------
    samples : (n_samples, n_channels)
        Forces or vibration from the time the tool is fully in the cut, in the SI units of the channels.
    sample_rate : Hz
        Samples a second.
    spindle_speed : rad/s
        Stated spindle speed, right within 1 %; it may drift by 1 %.
    teeth
        Number of teeth.
    runout : m
        Radial offset of the spindle's axis; 0: all teeth cut equal chips; infinite: it may have any size. With an even
        number of teeth runout has the lines of period doubling: where they do not grow, and the chip does not change by
        more than runout explains, the verdict is ``inconclusive`` instead of ``period-doubling``. NaN: not stated;
        period doubling is then told with a warning where it is large.
    derivatives : (n_channels,)
        Number of times each channel is differentiated: 2 for acceleration, 1 for velocity, 0 for displacement or force;
        empty: 0.
    natural_frequencies : Hz
        Natural frequencies of the structure. With them the line nearest to a mode gives the frequency; empty: the line
        of largest motion does.
    chip : m
        Thickest chip of the cut without vibration; NaN: not known.
    tool
        Channels that hold the tool's motion across its axis, in m and s; empty: all. Only used with ``chip``.
    modelled
        Cutter, structure and channels of the tip. With them an even number of teeth with runout is judged by the depth
        of cut at which the model moves like the recording. The verdict is then no test of the model.

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
    known = Knowledge(runout, kept, tuple(natural_frequencies))
    if math.isfinite(chip) and chip > 0:
        counted = np.array([not tool or number in tool for number in range(data.shape[1])])[moving]
        motion = ToolMotion(chip, teeth, evidence.track.mean_frequency, evidence.scales * counted, kept)
        known = replace(known, motion=motion)
    if modelled is not None and moving[list(modelled.columns)].all():
        first, second = (int(moving[:column].sum()) for column in modelled.columns)
        known = replace(known, modelled=replace(modelled, columns=(first, second)))
    verdict = concluded(evidence, known)
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
        raise InputError(
            "no channel holds any motion: all samples of each are equal; take other responses (--response)"
        )
    return data
