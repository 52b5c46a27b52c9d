"""`CutHypothesis`: the cutting force of a process with causes; `MeasuredCut`: recordings of a cut."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from millfrf.core import Complex, InputError, Real
from millfrf.cutting import MillingProcess, chip_forces, specific_forces

from .motion import SpindleLaw
from .physics import CutPhysics, ToothView
from .recordings import FINE, CutRecording, ForceNoise, ForceSpectra, noise_of, whitened

COEFFICIENT_NAMES = ("ktc_pa", "krc", "kac", "kte_n_per_m", "kre_n_per_m", "kae_n_per_m")


@dataclass(frozen=True)
class Belief:
    """Coefficients of a cutting file, and the standard deviation of their errors.

    ``ktc = ktc0 exp(e u_1)``, ``krc = krc0 + e max(|krc0|, 0.1) u_2``, ``kte = kte0 + e max(kte0, ktc0 f) u_4``, and
    similarly for the remaining coefficients. The deviations u are standard normal, and f is the feed per tooth.
    """

    process: MillingProcess
    error: float = 0.15  # standard deviation e of the error of a coefficient, a share

    def __post_init__(self) -> None:
        if not 0 < self.error < 1:
            raise InputError(f"coefficients off by {self.error!r}: give a share between 0 and 1, for example 0.15")

    @property
    def scales(self) -> Real:
        """Standard deviation of each coefficient, (6,); for ``ktc`` it is relative."""
        process = self.process
        edge = process.ktc * process.feed_per_tooth
        shares = [1.0, max(abs(process.krc), 0.1), max(abs(process.kac), 0.1)]
        return self.error * np.array(shares + [max(k, edge) for k in (process.kte, process.kre, process.kae)])

    @property
    def lowest(self) -> Real:
        """Lowest deviation of each coefficient, (6,), with which no edge coefficient is negative."""
        edges = np.array([self.process.kte, self.process.kre, self.process.kae])
        return np.concatenate([np.full(3, -40.0), -edges / self.scales[3:] - 1e-9])

    def process_at(self, deviations: Real) -> MillingProcess:
        """Return the process with its coefficients at these deviations.

        Examples
        --------
        >>> slot = MillingProcess(2, 0.01, np.pi / 2, 1e8, 0.3, 0.0, 0.0, np.pi, 1e-4)
        >>> moved = Belief(slot, 0.1).process_at(np.array([0.0, 1.0, 0.0, 0.0, 0.0, 0.0]))
        >>> round(moved.krc, 6)
        0.33
        """
        process, moved = self.process, self.scales * deviations
        return replace(
            process,
            ktc=process.ktc * float(np.exp(moved[0])),
            krc=process.krc + float(moved[1]),
            kac=process.kac + float(moved[2]),
            kte=max(process.kte + float(moved[3]), 0.0),
            kre=max(process.kre + float(moved[4]), 0.0),
            kae=max(process.kae + float(moved[5]), 0.0),
        )

    def named_numbers(self, deviations: Real, errors: Real) -> tuple[dict[str, float], dict[str, float]]:
        """Return coefficients and standard errors by the names of the cutting file, SI."""
        moved = self.process_at(deviations)
        values = (moved.ktc, moved.krc, moved.kac, moved.kte, moved.kre, moved.kae)
        spread = self.scales * errors * np.array([moved.ktc, 1.0, 1.0, 1.0, 1.0, 1.0])
        return dict(zip(COEFFICIENT_NAMES, values, strict=True)), dict(
            zip(COEFFICIENT_NAMES, map(float, spread), strict=True)
        )


# number of earlier tooth passings, at least one revolution, of whose surfaces the deepest one limits the chip
PASSINGS = 4


@dataclass(frozen=True)
class CutView:
    """Geometry of a cut under one spindle law."""

    count: int  # number of instants
    fine: int  # number of instants in each sample of the recording
    teeth: tuple[ToothView, ...]  # one view for each tooth
    earlier: int  # number of earlier tooth passings that are considered


def fineness(recording: CutRecording, top: float) -> int:
    """Return the number of instants per sample that is needed to resolve entry and exit of the teeth."""
    return max(1, math.ceil(FINE * top / recording.rate - 0.25))


def view_of(recording: CutRecording, process: MillingProcess, law: SpindleLaw, fine: int) -> CutView:
    """Return the position of every tooth for a spindle law.

    Tooth j of N teeth is at ``phi_j = angle + 2 pi j / N``. If it enters or leaves the cut between two instants, its
    force is computed at the middle of the part of the step in the cut, and weighted by the share of this part.
    """
    count = len(recording.force) * fine
    times = np.arange(count) / (recording.rate * fine)
    angles, speeds = law.angles(times), law.speeds(times)
    steps = speeds / (recording.rate * fine)
    earlier = max(PASSINGS, process.teeth)
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
    tooth_angles = angles + 2 * np.pi * number / process.teeth
    immersion = tooth_angles - 2 * np.pi * np.floor((tooth_angles + 0.5 * np.pi) / (2 * np.pi))
    low = np.maximum(immersion - 0.5 * steps, process.start_angle)
    high = np.minimum(immersion + 0.5 * steps, process.exit_angle)
    index = np.flatnonzero(high > low)
    middle = 0.5 * (low + high)[index]
    sine, cosine = np.sin(middle), np.cos(middle)
    edge = (math.sin(process.edge_angle), math.cos(process.edge_angle))
    normal = (sine * edge[0], cosine * edge[0], np.full(len(index), -edge[1]))
    outward, velocity = np.zeros((earlier + 1, len(index))), np.zeros(len(index))
    if recording.motion is not None:
        sample_times = recording.times
        for k in range(earlier + 1):
            at = times[index] - law.lag(times[index], 2 * np.pi * k / process.teeth)
            outward[k] = _projected(at, sample_times, recording.motion.displacement, normal)
        velocity = _projected(times[index], sample_times, recording.motion.velocity, normal)
    return ToothView(
        number, process.teeth, index, sine, cosine, *edge, ((high - low) / steps)[index], outward, velocity,
        speeds[index] * process.diameter / 2,
    )  # fmt: skip


def _projected(at: Real, times: Real, samples: Real, normal: tuple[Real, Real, Real]) -> Real:
    """Return the motion along the normal, interpolated at the given times."""
    total = np.zeros(len(at))
    for column, along in enumerate(normal):
        if samples[:, column].any():
            total += np.interp(at, times, samples[:, column]) * along
    return total


Acting = Sequence[tuple[CutPhysics, Real]]


def computed_force(process: MillingProcess, depth: float, view: CutView, acting: Acting) -> Real:
    """Return the force on the tool at every instant, (n_instants, 3), N.

    ``Ft = a (Ktc h + Kte / sin(gamma))`` for the depth a, and similarly for the radial and axial force (Mohammadi &
    Ahmadi, Eqs. 1 to 3), with the chip thickness ``h = min_k (k f sin(phi) sin(gamma) + e_0 - e_k)``, at least zero,
    or its equivalent by the :class:`ChipLaw` of the process. ``e_k`` is the displacement of the edge due to causes,
    ``k`` tooth passings ago. The force is rotated into X, Y, Z as in :func:`millfrf.cutting.tooth`.
    """
    total = np.zeros((view.count, 3))
    _, edge = specific_forces(process)
    for tooth in view.teeth:
        chip = chip_thickness(process, tooth, view.earlier, acting)
        cuts = chip > 0
        local = (depth * tooth.share * cuts)[:, None] * (chip_forces(process, chip) + edge / tooth.sine_edge)
        outward = local[:, 1] * tooth.sine_edge + local[:, 2] * tooth.cosine_edge
        tooth_force = np.empty((len(chip), 3))
        tooth_force[:, 0] = -local[:, 0] * tooth.cosine - outward * tooth.sine
        tooth_force[:, 1] = local[:, 0] * tooth.sine - outward * tooth.cosine
        tooth_force[:, 2] = local[:, 1] * tooth.cosine_edge - local[:, 2] * tooth.sine_edge
        for cause, values in acting:
            tooth_force += (depth * tooth.share * cuts)[:, None] * cause.force(values, tooth)
        total[tooth.index] += tooth_force
    return total


def chip_thickness(process: MillingProcess, tooth: ToothView, earlier: int, acting: Acting) -> Real:
    """Return the chip thickness at the instants of one tooth, (m,), m."""
    feed = process.feed_per_tooth * tooth.sine * tooth.sine_edge
    own = sum(cause.advance(values, tooth, 0) for cause, values in acting)
    thinnest = np.full(len(feed), np.inf)
    for k in range(1, earlier + 1):
        earlier_advance = sum(cause.advance(values, tooth, k) for cause, values in acting)
        thinnest = np.minimum(thinnest, k * feed + own - earlier_advance)
    return np.asarray(np.maximum(thinnest, 0.0))


@dataclass(frozen=True)
class CutHypothesis:
    """Coefficients, causes and spindle angles."""

    # deviations of the coefficients from the cutting file, in standard deviations of a laboratory, (6,)
    deviations: Real
    # every cause with its numbers (n_numbers,) in SI; a cause that is not fitted has the numbers of the cutting file
    acting: tuple[tuple[CutPhysics, Real], ...]
    laws: tuple[SpindleLaw, ...]

    def cause(self, name: str) -> CutPhysics:
        """Return a cause by its name."""
        return next(cause for cause, _ in self.acting if cause.name == name)

    def values(self, name: str) -> Real:
        """Return the numbers of one cause, (n_numbers,), SI."""
        return next(values for cause, values in self.acting if cause.name == name)

    def with_values(self, name: str, values: Real) -> "CutHypothesis":
        """Return the hypothesis with new numbers of one cause."""
        return replace(self, acting=tuple((cause, values if cause.name == name else old) for cause, old in self.acting))

    def with_angle(self, number: int, angle: float) -> "CutHypothesis":
        """Return the hypothesis with a new spindle angle in one recording."""
        laws = [replace(law, angle=angle) if k == number else law for k, law in enumerate(self.laws)]
        return replace(self, laws=tuple(laws))


@dataclass(frozen=True)
class MeasuredCut:
    """Recordings of a cut with cutter, depth and noise."""

    belief: Belief  # cutting process, and the standard deviation of its coefficients
    depth: float  # axial depth, m
    spectra: tuple[ForceSpectra, ...]
    force_error: float  # relative error of each spectral line of a correct computed force
    noise: tuple[ForceNoise, ...] = ()  # noise of each recording; empty as long as it is not known
    _views: dict[tuple[int, SpindleLaw], CutView] = field(default_factory=dict, repr=False, compare=False)

    def only(self, number: int) -> "MeasuredCut":
        """Return the cut with only the recording of index ``number``."""
        chosen = slice(number, number + 1)
        return replace(self, spectra=self.spectra[chosen], noise=self.noise[chosen], _views={})

    def noisier(self) -> "MeasuredCut":
        """Return the same cut with the noise of the tip motion added a second time."""
        spectra = tuple(replace(spectrum, recording=spectrum.recording.noisier()) for spectrum in self.spectra)
        return replace(self, spectra=spectra, _views={})

    def with_noise_of(self, hypothesis: CutHypothesis) -> "MeasuredCut":
        """Return the cut with the noise that the residual of a hypothesis shows."""
        predicted = [self.predicted(k, hypothesis) for k in range(len(self.spectra))]
        noise = tuple(
            noise_of(spectra, spectra.measured - force, force, self.force_error)
            for spectra, force in zip(self.spectra, predicted, strict=True)
        )
        return replace(self, noise=noise)

    def without_band(self, low: float, high: float) -> "MeasuredCut":
        """Return the cut with zero weight of the spectral lines between ``low`` and ``high``, Hz."""
        noises = []
        for spectra, noise in zip(self.spectra, self.noise, strict=True):
            place = spectra.frequencies / spectra.frequencies[-1]
            used = ~((place > low) & (place <= high))
            noises.append(replace(noise, whitener=noise.whitener * used[:, None, None]))
        return replace(self, noise=tuple(noises))

    def _view(self, number: int, law: SpindleLaw) -> CutView:
        """Return the teeth of one recording; the last few results are cached."""
        key = (number, law)
        if key not in self._views:
            if len(self._views) > 4 * len(self.spectra):
                self._views.clear()
            spectra = self.spectra[number]
            fine = fineness(spectra.recording, float(spectra.frequencies[-1]))
            self._views[key] = view_of(spectra.recording, self.belief.process, law, fine)
        return self._views[key]

    def predicted(self, number: int, hypothesis: CutHypothesis) -> Complex:
        """Return the spectra of the computed force, (n_blocks, n_lines, n_axes), N."""
        view, spectra = self._view(number, hypothesis.laws[number]), self.spectra[number]
        process = self.belief.process_at(hypothesis.deviations)
        force = computed_force(process, self.depth, view, hypothesis.acting)
        return spectra.of(force[:, list(spectra.recording.axes)], view.fine)

    def residual(self, number: int, hypothesis: CutHypothesis) -> Complex:
        """Return measured minus computed spectra, (n_blocks, n_lines, n_axes).

        They are whitened if the noise is known, otherwise in N.
        """
        residual = self.spectra[number].measured - self.predicted(number, hypothesis)
        return whitened(self.noise[number], residual) if self.noise else residual

    def block_misfits(self, number: int, hypothesis: CutHypothesis) -> Real:
        """Return the misfit ``2 sum |W r|^2`` of every block of a recording, (n_blocks,)."""
        return np.asarray(2 * np.sum(np.abs(self.residual(number, hypothesis)) ** 2, axis=(1, 2)))
