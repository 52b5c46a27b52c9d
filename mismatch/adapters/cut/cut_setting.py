"""`CutSetting` and `Attempt`: what stays the same while causes are compared, and one set of numbers put to it."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from .force.computed_force import Acting, computed_force
from .force.cut_view import CutView, fineness, view_of
from .force.force_coefficients import Belief
from .force.force_lines import ForceLines
from .force.force_noise import ForceNoise, whitened
from .physics import CutPhysics
from .recordings.spindle_law import SpindleLaw

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


@dataclass(frozen=True)
class Attempt:
    """One set of numbers.

    Parameters
    ----------
    deviations : (6,)
        Of the coefficients.
    acting
        Causes with their numbers, those of the cutting file among them.
    laws
        Spindle, one a recording.
    """

    deviations: Real
    acting: tuple[tuple[CutPhysics, Real], ...]
    laws: tuple[SpindleLaw, ...]

    def values(self, name: str) -> Real:
        """Numbers of one cause."""
        return next(values for cause, values in self.acting if cause.name == name)

    def with_values(self, name: str, values: Real) -> "Attempt":
        """With other numbers of one cause."""
        return replace(self, acting=tuple((c, values if c.name == name else old) for c, old in self.acting))


@dataclass(frozen=True)
class CutSetting:
    """Recordings, cutter and depth.

    Parameters
    ----------
    belief
        Process and what its coefficients may be off.
    depth
        Axial depth, m.
    lines
        Recordings.
    force_error
        Share by which each line of a right computed force is still off.
    noise
        One a recording; empty before it is known.
    """

    belief: Belief
    depth: float
    lines: tuple[ForceLines, ...]
    force_error: float
    noise: tuple[ForceNoise, ...] = ()
    _views: dict[tuple[int, SpindleLaw], CutView] = field(default_factory=dict, repr=False, compare=False)

    def only(self, number: int) -> "CutSetting":
        """The same with one of the recordings."""
        return replace(self, lines=self.lines[number : number + 1], noise=self.noise[number : number + 1], _views={})

    def noisier(self) -> "CutSetting":
        """With the noise of the tip's motion a second time."""
        lines = tuple(replace(one, recording=one.recording.noisier()) for one in self.lines)
        return replace(self, lines=lines, _views={})

    def view(self, number: int, law: SpindleLaw) -> CutView:
        """Teeth of one recording; the last few are kept."""
        key = (number, law)
        if key not in self._views:
            if len(self._views) > 4 * len(self.lines):
                self._views.clear()
            lines = self.lines[number]
            fine = fineness(lines.recording, float(lines.frequencies[-1]))
            self._views[key] = view_of(lines.recording, self.belief.process, law, fine)
        return self._views[key]

    def force(self, number: int, attempt: Attempt) -> Real:
        """Computed force along one recording, (n_instants, n_axes), N."""
        view = self.view(number, attempt.laws[number])
        acting: Acting = attempt.acting
        force = computed_force(self.belief.process_at(attempt.deviations), self.depth, view, acting)
        return np.asarray(force[:, list(self.lines[number].recording.axes)])

    def shown(self, number: int, attempt: Attempt) -> Complex:
        """Its lines, (n_blocks, n_lines, n_axes)."""
        view = self.view(number, attempt.laws[number])
        return self.lines[number].cut(self.force(number, attempt), view.fine)

    def residual(self, number: int, attempt: Attempt) -> Complex:
        """Measured less computed lines, whitened once the noise is known."""
        rest = self.lines[number].measured - self.shown(number, attempt)
        return whitened(self.noise[number], rest) if self.noise else rest
