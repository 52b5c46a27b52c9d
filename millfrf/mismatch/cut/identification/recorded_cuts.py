"""Forces of recorded cuts as spindle orders."""

import math
import os
from dataclasses import replace
from fractions import Fraction

import numpy as np

from acquisition import opened
from estimation import band_recording, before_force_high_pass, channel_at, channels_in_words
from millfrf.core import TIP, InputError, Real
from millfrf.cutting import MillingProcess, refuse_varied
from millfrf.stability import CHATTER, INCONCLUSIVE, classify_cut

from ..motion import stated_law
from .cut_forces import CutForces
from .dynamometer import Dynamometer
from .turn_spectra import TurnSpectra, turn_spectra

PASSINGS = 4  # highest compared harmonic of the tooth passing
JUDGED_REVOLUTIONS = 40  # least number by which :func:`millfrf.stability.classify_cut` judges
STEADY = 0.01  # largest relative change of the speed for which a cut is judged for chatter
LARGEST_SHARE = 0.4  # of the sample rate, up to which a recording shows forces


def read_cut_forces(
    path: str | os.PathLike[str],
    process: MillingProcess,
    depth: float,
    *,
    speed: float | None = None,
    highest: float | None = None,
    stream: str | None = None,
    dynamometer: Dynamometer | None = None,
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
    dynamometer
        Transfer of the dynamometer; None: taken as rigid.

    Returns
    -------
    CutForces
        Spindle orders.
    tuple of str
        Names of the force channels.

    Raises
    ------
    InputError
        A cutter that is no square end mill with one helix, a force is missing, no speed is stated, too few revolutions
        lie in the cut, the cut chatters, or the transfer of the dynamometer ends below ``highest``.
    """
    refuse_varied(
        process,
        "the identification of force coefficients",
        "cut with a square end mill whose teeth have one helix angle",
        takes=("helix", "pitch", "damping", "runout"),
    )
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
    if dynamometer is not None:
        if highest is not None and highest > dynamometer.highest:
            raise InputError(
                f"the FRF of the dynamometer ends at {dynamometer.highest:.4g} Hz, below --highest {highest:g}; "
                "compare lower frequencies, or tap with a harder hammer tip"
            )
        limit = min(limit, dynamometer.highest)
    top = int(limit / turning * (1 + 1e-9))
    if top < 1:
        raise InputError(
            f"{source.path.name}: the spindle turns at {turning:.4g} Hz, above the highest compared frequency of "
            f"{limit:.4g} Hz; compare up to at least the tooth passing, {process.teeth * turning:.4g} Hz"
        )
    orders = turn_spectra(samples.name, samples.force, samples.rate, stated, process.teeth, top)
    doubts = _refuse_chatter(samples.name, samples.force[orders.cut], samples.rate, orders, process.teeth)
    cut = CutForces(
        samples.name, process, depth, orders.mean, orders.error, orders.drift, measured, orders.turning, doubts=doubts
    )
    if dynamometer is not None:
        cut = through_dynamometer(cut, dynamometer)
    return cut, tuple(channel.channel.name for channel in forces)


def through_dynamometer(cut: CutForces, dynamometer: Dynamometer) -> CutForces:
    """Return a cut whose computed forces pass the dynamometer before they are compared with the measured ones.

    Errors of the transfer count as errors of the measured orders, in proportion to the forces.
    """
    transfer, variance = dynamometer.at_orders(cut.turning, cut.top, cut.axes)
    error = np.sqrt(cut.error**2 + np.einsum("kpq,kq->kp", variance, np.abs(cut.mean) ** 2))
    return replace(cut, transfer=transfer, error=error)


def _refuse_chatter(name: str, force: Real, rate: float, orders: TurnSpectra, teeth: int) -> tuple[str, ...]:
    """Refuse a cut that chatters, whose forces are not those of the feed alone; return a doubt if it is not judged."""
    speeds = orders.turning
    if np.ptp(speeds) > STEADY * speeds.mean():
        return (f"{name}: the speed is swept, and chatter is judged at constant speed only",)
    if orders.revolutions < JUDGED_REVOLUTIONS:
        return (f"{name}: {orders.revolutions} revolutions are too few to judge chatter ({JUDGED_REVOLUTIONS})",)
    verdict = classify_cut(force, rate, 2 * math.pi * float(speeds.mean()), teeth)
    if verdict.kind in CHATTER:
        raise InputError(
            f"{name}: the cut chatters ({verdict.kind}): {verdict.reason}; leave this recording and its feed out, or "
            "cut less deep"
        )
    return (f"{name}: whether it chatters is open: {verdict.reason}",) if verdict.kind == INCONCLUSIVE else ()
