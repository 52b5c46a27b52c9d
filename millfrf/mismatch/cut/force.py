"""Cutting force that a process and a set of causes give along a recording."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from millfrf.core import InputError, Real
from millfrf.cutting import MillingProcess, specific_forces

from .physics import CutPhysics, ToothView
from .recordings import FINE, CutRecording
from .spindle_law import SpindleLaw

COEFFICIENT_NAMES = ("ktc_pa", "krc", "kac", "kte_n_per_m", "kre_n_per_m", "kae_n_per_m")


@dataclass(frozen=True)
class Belief:
    """The coefficients of a cutting file and one standard deviation of what they are off.

    ``ktc = ktc0 exp(e u_1)``, ``krc = krc0 + e max(|krc0|, 0.1) u_2``, ``kte = kte0 + e max(kte0, ktc0 f) u_4``, and
    alike the others: the deviations u are standard normal.

    Parameters
    ----------
    process
        Cutting process as its file states it.
    error
        One standard deviation e of what a coefficient is off, a share.

    Raises
    ------
    InputError
        The error is not a positive share.
    """

    process: MillingProcess
    error: float = 0.15

    def __post_init__(self) -> None:
        if not 0 < self.error < 1:
            raise InputError(f"coefficients off by {self.error!r}: give a share between 0 and 1, for example 0.15")

    @property
    def scales(self) -> Real:
        """One standard deviation of each coefficient, (6,); that of ``ktc`` is relative."""
        one = self.process
        edge = one.ktc * one.feed_per_tooth
        shares = [1.0, max(abs(one.krc), 0.1), max(abs(one.kac), 0.1)]
        return self.error * np.array(shares + [max(k, edge) for k in (one.kte, one.kre, one.kae)])

    @property
    def lowest(self) -> Real:
        """Deviations below which an edge coefficient would be negative, (6,)."""
        edges = np.array([self.process.kte, self.process.kre, self.process.kae])
        return np.concatenate([np.full(3, -40.0), -edges / self.scales[3:] - 1e-9])

    def process_at(self, deviations: Real) -> MillingProcess:
        """The process with its coefficients moved.

        Parameters
        ----------
        deviations : (6,)
            Deviations u, in standard deviations.

        Examples
        --------
        >>> slot = MillingProcess(2, 0.01, np.pi / 2, 1e8, 0.3, 0.0, 0.0, np.pi, 1e-4)
        >>> moved = Belief(slot, 0.1).process_at(np.array([0.0, 1.0, 0.0, 0.0, 0.0, 0.0]))
        >>> round(moved.krc, 6)
        0.33
        """
        one, moved = self.process, self.scales * deviations
        return replace(
            one,
            ktc=one.ktc * float(np.exp(moved[0])),
            krc=one.krc + float(moved[1]),
            kac=one.kac + float(moved[2]),
            kte=max(one.kte + float(moved[3]), 0.0),
            kre=max(one.kre + float(moved[4]), 0.0),
            kae=max(one.kae + float(moved[5]), 0.0),
        )

    def told(self, deviations: Real, errors: Real) -> tuple[dict[str, float], dict[str, float]]:
        """Coefficients and standard errors by the names of the cutting file, SI.

        Parameters
        ----------
        deviations : (6,)
            Deviations u, in standard deviations.
        errors : (6,)
            Standard errors of the deviations.
        """
        moved = self.process_at(deviations)
        values = (moved.ktc, moved.krc, moved.kac, moved.kte, moved.kre, moved.kae)
        spread = self.scales * errors * np.array([moved.ktc, 1.0, 1.0, 1.0, 1.0, 1.0])
        return dict(zip(COEFFICIENT_NAMES, values, strict=True)), dict(
            zip(COEFFICIENT_NAMES, map(float, spread), strict=True)
        )


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


Acting = Sequence[tuple[CutPhysics, Real]]


def computed_force(process: MillingProcess, depth: float, view: CutView, acting: Acting) -> Real:
    """Force on the tool at every instant, (n_instants, 3), N.

    ``Ft = a (Ktc h + Kte / sin(gamma))`` and alike radial and axial (Mohammadi & Ahmadi, Eqs. 1 to 3), with
    ``h = min_k (k f sin(phi) sin(gamma) + e_0 - e_k)``, not below zero, where ``e_k`` is how far the edges that causes
    displace stood out ``k`` tooth passings ago; turned into X, Y, Z as :func:`millfrf.cutting.tooth` does.

    Parameters
    ----------
    process
        Coefficients, cutter and feed; runout and process damping are causes, and are not read here.
    depth
        Axial depth a, m.
    view
        Where the teeth stand at every instant, and how the tip moves.
    acting
        Causes, each with its numbers (n_numbers,) in SI.
    """
    total = np.zeros((view.count, 3))
    cutting, edge = specific_forces(process)
    for tooth in view.teeth:
        chip = chip_thickness(process, tooth, view.earlier, acting)
        cuts = chip > 0
        local = (depth * tooth.share * cuts)[:, None] * (chip[:, None] * cutting + edge / tooth.sine_edge)
        outward = local[:, 1] * tooth.sine_edge + local[:, 2] * tooth.cosine_edge
        there = np.empty((len(chip), 3))
        there[:, 0] = -local[:, 0] * tooth.cosine - outward * tooth.sine
        there[:, 1] = local[:, 0] * tooth.sine - outward * tooth.cosine
        there[:, 2] = local[:, 1] * tooth.cosine_edge - local[:, 2] * tooth.sine_edge
        for cause, values in acting:
            there += (depth * tooth.share * cuts)[:, None] * cause.force(values, tooth)
        total[tooth.index] += there
    return total


def chip_thickness(process: MillingProcess, tooth: ToothView, earlier: int, acting: Acting) -> Real:
    """Chip thickness at the instants of one tooth, (m,), m.

    Parameters
    ----------
    process
        Process that gives the feed per tooth.
    tooth
        The tooth that cuts.
    earlier
        Number of tooth passings that are looked back.
    acting
        Causes, each with its numbers (n_numbers,) in SI.
    """
    feed = process.feed_per_tooth * tooth.sine * tooth.sine_edge
    own = sum(cause.advance(values, tooth, 0) for cause, values in acting)
    thinnest = np.full(len(feed), np.inf)
    for k in range(1, earlier + 1):
        left = sum(cause.advance(values, tooth, k) for cause, values in acting)
        thinnest = np.minimum(thinnest, k * feed + own - left)
    return np.asarray(np.maximum(thinnest, 0.0))
