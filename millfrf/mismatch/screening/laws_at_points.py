"""The same law in several joints whose coordinates are driven and measured, as friction in all joints of an arm.

The search adds one cause after the other. Where two joints rub alike, friction in one of them alone may explain less
than an added mode, which ends the search. All joints are therefore also tried together, with a number for each joint.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import scipy

from estimation import WindowedSpectrum
from millfrf.core import DegreeOfFreedom, Real

from ..inference.search import in_processes
from ..inference.settings import ScreeningSettings
from ..joints.joint_axis import JointAxis, tip_axes
from ..models.cause import Cause
from ..models.fitting import Fit, at_nominal_modes, fit
from ..models.hypothesis import Hypothesis
from ..models.settings import FITTING
from ..physics.protocol import JointPhysics, reported_name
from .joint_places import EstimatedMotion, motion_of, static_stiffness
from .joint_starts import ROUGH_LINES

DRIVEN_STEPS = 4  # most steps of a fit to the measured motion

# strengths at which the laws of all joints are simulated, as factors of those that fit the measured motion
STRENGTHS = (0.5, 1.0, 2.0)


def driven_points(hypothesis: Hypothesis) -> int:
    """Return at how many points the structure is driven and measured along one axis each; 0 if any has several axes."""
    driven, shown = (
        [DegreeOfFreedom.parse(label) for label in labels]
        for labels in (hypothesis.model.excitations, hypothesis.model.responses)
    )
    nodes = {each.node for each in driven}
    measured = {(each.node, each.axis) for each in shown}
    single = len(nodes) == len(driven) and all((each.node, each.axis) in measured for each in driven)
    return len(nodes) if single else 0


def laws_at_points(
    lines: list[WindowedSpectrum], current: Fit, laws: Sequence[JointPhysics], settings: ScreeningSettings
) -> list[Fit]:
    """Fit laws at all driven points together, each law once, best first; none with fewer than two points.

    Every shape of a law is first fitted with forces that follow the measured motion, where all strengths are linear, at
    the nominal modes. The laws that explain most are then simulated in several strengths and fitted from the best.

    Parameters
    ----------
    lines
        Windowed spectra of the recordings.
    current
        Fit whose hypothesis the laws extend.
    laws
        Joint laws of the library.
    settings
        Holds the largest number of laws that are simulated.
    """
    nominal = at_nominal_modes(current.hypothesis)
    if driven_points(nominal) < 2:
        return []
    motions = [_measured_motions(recording, nominal) for recording in lines]
    tasks = [
        partial(_followed, lines, nominal, causes) for law in laws for causes in _shapes(lines, nominal, law, motions)
    ]
    driven = sorted((fitted for fitted in in_processes(tasks) if np.isfinite(fitted.score)), key=lambda f: f.score)
    best: dict[str, Fit] = {}
    for fitted in driven:
        best.setdefault(reported_name(fitted.hypothesis.causes[-1].physics), fitted)
    tried = list(best.values())[: settings.most_laws]
    count = driven_points(nominal)
    simulated = in_processes([partial(_simulated, lines, fitted, count) for fitted in tried])
    return sorted((fitted for fitted in simulated if np.isfinite(fitted.score)), key=lambda fitted: fitted.score)


def _measured_motions(lines: WindowedSpectrum, hypothesis: Hypothesis) -> list[EstimatedMotion]:
    """Return the measured deflection and velocity of each driven point in the compared band, without a force."""
    rows = tip_axes(hypothesis.model)[0]
    n, frequencies = len(lines.recording.response), lines.padded_frequencies
    band = (frequencies >= lines.frequencies[0]) & (frequencies <= lines.frequencies[-1])
    spectrum = np.zeros((len(frequencies), rows.shape[1]), dtype=complex)
    shown = scipy.fft.rfft(lines.recording.response, n=lines.padded, axis=0)
    spectrum[band] = (shown[band] / lines.padded_kinematic[band]) @ rows
    rate = 2j * np.pi * frequencies[:, None]
    deflection, velocity = (scipy.fft.irfft(each, n=lines.padded, axis=0)[:n] for each in (spectrum, rate * spectrum))
    return [EstimatedMotion(x, v, np.zeros(n)) for x, v in zip(deflection.T, velocity.T, strict=True)]


def _shapes(
    lines: Sequence[WindowedSpectrum],
    nominal: Hypothesis,
    law: JointPhysics,
    motions: Sequence[Sequence[EstimatedMotion]],
) -> Iterator[tuple[Cause, ...]]:
    """Yield a cause for each driven point in every shape of a law."""
    causes = []
    for point in range(driven_points(nominal)):
        axis = JointAxis(np.eye(driven_points(nominal))[point])
        here = [recording[point] for recording in motions]
        motion = motion_of(here, static_stiffness(nominal, axis), (each.recording for each in lines))
        seen: Mapping[str, tuple[Real, Real]] = {
            each.recording.name: (state.deflection, state.velocity) for each, state in zip(lines, here, strict=True)
        }
        causes.append([Cause(law, shape, "", axis, motion, seen) for shape in law.starts(motion)])
    yield from zip(*causes, strict=True)


def _followed(lines: list[WindowedSpectrum], nominal: Hypothesis, causes: tuple[Cause, ...]) -> Fit:
    """Fit laws that follow the measured motion."""
    rough = [recording.thinned(ROUGH_LINES) for recording in lines]
    return fit(rough, _with(nominal, causes), iterations=DRIVEN_STEPS)


def _simulated(lines: list[WindowedSpectrum], driven: Fit, count: int) -> Fit:
    """Simulate the laws of a fit in several strengths, and fit them from the best."""
    hypothesis, starts = driven.hypothesis, []
    others, laws = hypothesis.causes[:-count], hypothesis.causes[-count:]
    for modes in (hypothesis, at_nominal_modes(hypothesis)):
        for strength in STRENGTHS:
            causes = tuple(_scaled(cause, strength) for cause in laws)
            starts.append(fit(lines, _with(modes, causes, others), iterations=0))
    best = min(starts, key=lambda start: start.score)
    if not np.isfinite(best.score):
        return best
    return fit(lines, best.hypothesis, best.noises, iterations=FITTING.restart_iterations)


def _scaled(cause: Cause, strength: float) -> Cause:
    """Return a cause that is simulated freely, with its first number times a factor."""
    first = cause.physics.parameters[0]
    values = cause.values.copy()
    values[0] = np.clip(strength * values[0], first.low, first.high)
    return Cause(cause.physics, values, "", cause.axis, cause.motion)


def _with(hypothesis: Hypothesis, causes: tuple[Cause, ...], others: tuple[Cause, ...] | None = None) -> Hypothesis:
    """Return the hypothesis with further causes, or with them and no other causes than ``others``."""
    before = hypothesis.causes if others is None else others
    return replace(hypothesis, causes=(*before, *causes))
