"""`CutHypothesis`: parameters from which the cutting force is computed; `MeasuredCut`: recordings of a cut."""

from dataclasses import dataclass, field, replace

import numpy as np

from millfrf.core import Complex, Real

from .force import Belief, CutView, computed_force, fineness, view_of
from .physics import CutPhysics
from .spectra import ForceNoise, ForceSpectra, noise_of, whitened
from .spindle_law import SpindleLaw


@dataclass(frozen=True)
class CutHypothesis:
    """Coefficients, causes and the spindle's angle.

    Parameters
    ----------
    deviations : (6,)
        Deviations of the coefficients from the cutting file, in a laboratory's standard deviations.
    acting
        Every cause with its numbers (n_numbers,) in SI; causes that are not fitted keep those of the cutting file.
    laws
        Spindle law of each recording.
    """

    deviations: Real
    acting: tuple[tuple[CutPhysics, Real], ...]
    laws: tuple[SpindleLaw, ...]

    def cause(self, name: str) -> CutPhysics:
        """A cause by its name.

        Parameters
        ----------
        name
            Name of the cause.
        """
        return next(cause for cause, _ in self.acting if cause.name == name)

    def values(self, name: str) -> Real:
        """Numbers of one cause, (n_numbers,), SI.

        Parameters
        ----------
        name
            Name of the cause.
        """
        return next(values for cause, values in self.acting if cause.name == name)

    def with_values(self, name: str, values: Real) -> "CutHypothesis":
        """The same hypothesis with other numbers of one cause.

        Parameters
        ----------
        name
            Name of the cause.
        values : (n_numbers,)
            New numbers of the cause, SI.
        """
        return replace(self, acting=tuple((one, values if one.name == name else old) for one, old in self.acting))

    def with_angle(self, number: int, angle: float) -> "CutHypothesis":
        """The same hypothesis with another spindle angle in one recording.

        Parameters
        ----------
        number
            Number of the recording, from 0.
        angle
            Angle of tooth 0 at the middle of the recording, rad.
        """
        laws = [replace(law, angle=angle) if k == number else law for k, law in enumerate(self.laws)]
        return replace(self, laws=tuple(laws))


@dataclass(frozen=True)
class MeasuredCut:
    """Recordings of a cut with its cutter, depth and noise.

    Parameters
    ----------
    belief
        Cutting process, and how far its coefficients may be off.
    depth
        Axial depth, m.
    spectra
        Spectra of each recording.
    force_error
        Share by which each spectral line of a right computed force is still off.
    noise
        Noise of each recording; empty before it is known.
    """

    belief: Belief
    depth: float
    spectra: tuple[ForceSpectra, ...]
    force_error: float
    noise: tuple[ForceNoise, ...] = ()
    _views: dict[tuple[int, SpindleLaw], CutView] = field(default_factory=dict, repr=False, compare=False)

    def only(self, number: int) -> "MeasuredCut":
        """The same cut with one of the recordings.

        Parameters
        ----------
        number
            Number of the recording, from 0.
        """
        one = slice(number, number + 1)
        return replace(self, spectra=self.spectra[one], noise=self.noise[one], _views={})

    def noisier(self) -> "MeasuredCut":
        """The same cut with the noise of the tip's motion added a second time."""
        spectra = tuple(replace(one, recording=one.recording.noisier()) for one in self.spectra)
        return replace(self, spectra=spectra, _views={})

    def with_noise_of(self, hypothesis: CutHypothesis) -> "MeasuredCut":
        """The same cut with the noise that a hypothesis leaves.

        Parameters
        ----------
        hypothesis
            A fit with all causes, so that little but noise is left.
        """
        predicted = [self.predicted(k, hypothesis) for k in range(len(self.spectra))]
        noise = tuple(
            noise_of(spectra, spectra.measured - one, one, self.force_error)
            for spectra, one in zip(self.spectra, predicted, strict=True)
        )
        return replace(self, noise=noise)

    def without_band(self, low: float, high: float) -> "MeasuredCut":
        """The same cut with the spectral lines of one band given no weight.

        Parameters
        ----------
        low, high
            Edges of the band as shares of the highest frequency of each recording; ``low`` itself is not in it.
        """
        noises = []
        for spectra, noise in zip(self.spectra, self.noise, strict=True):
            place = spectra.frequencies / spectra.frequencies[-1]
            kept = ~((place > low) & (place <= high))
            noises.append(replace(noise, whitener=noise.whitener * kept[:, None, None]))
        return replace(self, noise=tuple(noises))

    def _view(self, number: int, law: SpindleLaw) -> CutView:
        """Teeth of one recording; the last few are kept."""
        key = (number, law)
        if key not in self._views:
            if len(self._views) > 4 * len(self.spectra):
                self._views.clear()
            spectra = self.spectra[number]
            fine = fineness(spectra.recording, float(spectra.frequencies[-1]))
            self._views[key] = view_of(spectra.recording, self.belief.process, law, fine)
        return self._views[key]

    def predicted(self, number: int, hypothesis: CutHypothesis) -> Complex:
        """Spectra of the computed force, (n_blocks, n_lines, n_axes), N.

        Parameters
        ----------
        number
            Number of the recording, from 0.
        hypothesis
            Numbers from which the force is computed.
        """
        view, spectra = self._view(number, hypothesis.laws[number]), self.spectra[number]
        process = self.belief.process_at(hypothesis.deviations)
        force = computed_force(process, self.depth, view, hypothesis.acting)
        return spectra.of(force[:, list(spectra.recording.axes)], view.fine)

    def residual(self, number: int, hypothesis: CutHypothesis) -> Complex:
        """Measured less computed spectra, (n_blocks, n_lines, n_axes); whitened once the noise is known, else N.

        Parameters
        ----------
        number
            Number of the recording, from 0.
        hypothesis
            Numbers from which the force is computed.
        """
        rest = self.spectra[number].measured - self.predicted(number, hypothesis)
        return whitened(self.noise[number], rest) if self.noise else rest

    def block_misfits(self, number: int, hypothesis: CutHypothesis) -> Real:
        """Misfit ``2 sum |W r|^2`` of every block of a recording, (n_blocks,).

        Parameters
        ----------
        number
            Number of the recording, from 0.
        hypothesis
            Numbers from which the force is computed.
        """
        return np.asarray(2 * np.sum(np.abs(self.residual(number, hypothesis)) ** 2, axis=(1, 2)))
