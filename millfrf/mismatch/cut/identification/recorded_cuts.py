"""Forces of recorded cuts as spindle orders."""

import math
import os
from fractions import Fraction

from acquisition import opened
from estimation import band_recording, before_force_high_pass, channel_at, channels_in_words
from millfrf.core import TIP, InputError
from millfrf.cutting import MillingProcess

from ..motion import stated_law
from .cut_forces import CutForces
from .turn_spectra import turn_spectra

PASSINGS = 4  # highest compared harmonic of the tooth passing
LARGEST_SHARE = 0.4  # of the sample rate, up to which a recording shows forces


def read_cut_forces(
    path: str | os.PathLike[str],
    process: MillingProcess,
    depth: float,
    *,
    speed: float | None = None,
    highest: float | None = None,
    stream: str | None = None,
) -> tuple[CutForces, tuple[str, ...]]:
    """Read the forces of one cut and compute their spindle orders.

    Parameters
    ----------
    path
        Recording with forces at ``TCP``, X and Y at least.
    process
        Cutter, engagement and feed of this cut.
    depth : m
        Axial depth of cut.
    speed : rad/s
        Spindle speed within 2 %; None: as the recording states it.
    highest : Hz
        Highest frequency that is compared; None: the fourth harmonic of the tooth passing.
    stream
        Sample clock; None: the only one.

    Returns
    -------
    CutForces
        Spindle orders.
    tuple of str
        Names of the force channels.

    Raises
    ------
    InputError
        A force is missing, no speed is stated, or too few revolutions lie in the cut.
    """
    stated = stated_law(path, speed)
    with opened(path) as recording:
        source = recording.stream(stream)
        channels = [channel_at(source.channels, label, ("force",)) for label in TIP]
        measured = tuple(axis for axis, channel in enumerate(channels) if channel is not None)
        if not {0, 1} <= set(measured):
            has = channels_in_words(source.channels)
            raise InputError(f"{source.path.name}: forces at TCP:+X and TCP:+Y are needed; it has {has}")
        forces = [channel for channel in channels if channel is not None]
        samples = before_force_high_pass(band_recording(source, forces, [], Fraction(1)))
    turning = stated.about(len(samples.force) / samples.rate / 2).speed / (2 * math.pi)
    limit = min(highest or PASSINGS * process.teeth * turning, LARGEST_SHARE * samples.rate)
    top = int(limit / turning * (1 + 1e-9))
    if top < 1:
        raise InputError(
            f"{source.path.name}: the spindle turns at {turning:.4g} Hz, above the highest compared frequency of "
            f"{limit:.4g} Hz; compare up to at least the tooth passing, {process.teeth * turning:.4g} Hz"
        )
    orders = turn_spectra(samples.name, samples.force, samples.rate, stated, process.teeth, top)
    cut = CutForces(samples.name, process, depth, orders.mean, orders.error, orders.drift, measured)
    return cut, tuple(channel.channel.name for channel in forces)
