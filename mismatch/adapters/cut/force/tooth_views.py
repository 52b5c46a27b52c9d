"""Where every tooth stands at every instant of a recording, and how the tip moves there: `CutView`."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cutting import MillingProcess

from ..physics import ToothView
from ..recordings import FINE, CutRecording, SpindleLaw

Real = NDArray[np.float64]

EARLIER = 4
"""Number of tooth passings looked back, or a revolution if that is more: the surface is the deepest of theirs."""


@dataclass(frozen=True)
class CutView:
    """Geometry of a cut under one spindle law.

    Parameters
    ----------
    count
        Number of instants.
    fine
        Number of instants in each sample of the recording.
    teeth
        One view for each tooth.
    earlier
        Number of tooth passings that are looked back.
    """

    count: int
    fine: int
    teeth: tuple[ToothView, ...]
    earlier: int


def fineness(recording: CutRecording, top: float) -> int:
    """Number of instants in each sample that resolves entry and exit.

    Parameters
    ----------
    recording
        Recording that gives the sampling rate.
    top
        Highest frequency that is compared, Hz.
    """
    return max(1, math.ceil(FINE * top / recording.rate - 0.25))


def view_of(recording: CutRecording, process: MillingProcess, law: SpindleLaw, fine: int) -> CutView:
    """Where every tooth stands under a spindle law.

    Tooth j stands at ``phi_j = angle + 2 pi j / N``. Between two instants it enters or leaves: the share of the step
    that lies in the immersion weighs its force, which is taken at the middle of that part.

    Parameters
    ----------
    recording
        Recording that gives instants and, where it is known, the tip's motion.
    process
        Process that gives teeth, diameter, edge angle and immersion.
    law
        Angle and speed of the spindle.
    fine
        Instants in each sample.
    """
    count = len(recording.force) * fine
    times = np.arange(count) / (recording.rate * fine)
    angles, speeds = law.angles(times), law.speeds(times)
    steps = speeds / (recording.rate * fine)
    earlier = max(EARLIER, process.teeth)
    teeth = tuple(
        _tooth(j, recording, process, law, (times, angles, speeds, steps), earlier) for j in range(process.teeth)
    )
    return CutView(count, fine, teeth, earlier)


def _tooth(
    number: int,
    recording: CutRecording,
    process: MillingProcess,
    law: SpindleLaw,
    axis: tuple[Real, Real, Real, Real],
    earlier: int,
) -> ToothView:
    times, angles, speeds, steps = axis
    turned = angles + 2 * np.pi * number / process.teeth
    immersion = turned - 2 * np.pi * np.floor((turned + 0.5 * np.pi) / (2 * np.pi))
    low = np.maximum(immersion - 0.5 * steps, process.start_angle)
    high = np.minimum(immersion + 0.5 * steps, process.exit_angle)
    index = np.flatnonzero(high > low)
    middle = 0.5 * (low + high)[index]
    sine, cosine = np.sin(middle), np.cos(middle)
    edge = (math.sin(process.edge_angle), math.cos(process.edge_angle))
    normal = (sine * edge[0], cosine * edge[0], np.full(len(index), -edge[1]))
    outward, velocity = np.zeros((earlier + 1, len(index))), np.zeros(len(index))
    if recording.motion is not None:
        own = recording.times
        for k in range(earlier + 1):
            at = times[index] - law.lag(times[index], 2 * np.pi * k / process.teeth)
            outward[k] = _projected(at, own, recording.motion.displacement, normal)
        velocity = _projected(times[index], own, recording.motion.velocity, normal)
    return ToothView(
        number, process.teeth, index, sine, cosine, *edge, ((high - low) / steps)[index], outward, velocity,
        speeds[index] * process.diameter / 2,
    )  # fmt: skip


def _projected(at: Real, times: Real, samples: Real, normal: tuple[Real, Real, Real]) -> Real:
    """Motion along the normal at other times than the samples'."""
    total = np.zeros(len(at))
    for column, along in enumerate(normal):
        if samples[:, column].any():
            total += np.interp(at, times, samples[:, column]) * along
    return total
