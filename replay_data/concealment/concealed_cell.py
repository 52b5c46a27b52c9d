"""`ConcealedCell`: milling tests of a robot that hides one effect; a source of recordings that do not tell it."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from acquisition import Block, StreamDescription
from modal_fit import ModalModel

from ..laboratory import ACETAL_CUTTER, Decimator, Sensor, dynamometer, setup_text, tip_accelerometers
from ..milling_cell import MillingCell
from ..sampled_cell import STREAM
from ..simulation import tip_motion
from ..speed_profiles import LinearSweep
from .concealed_chain import in_converter, through_chain
from .concealed_effect import ConcealedEffect
from .concealed_structure import concealed_law, concealed_structure, unmeasured_force

Real = NDArray[np.float64]

FINE_RATE, RATE = 8192.0, 512.0
"""Sample rates of the simulation and of the recordings, Hz."""

RPM = math.pi / 30
SWEEP_RPM = (240.0, 1080.0)
"""8 to 36 tooth passes a second."""

DEPTH = 1e-3
IMMERSION = (0.38 * math.pi, math.pi)
LEVELS = {"low": 0.1e-3, "mid": 0.2e-3, "high": 0.35e-3}
"""Feed per tooth, m."""

CUTTER = replace(ACETAL_CUTTER, start_angle=IMMERSION[0], exit_angle=IMMERSION[1], feed_per_tooth=LEVELS["mid"])


def milling_force(structure: ModalModel, level: str, seconds: float, seed: int) -> Real:
    """Force on the tip of the linear robot while it mills porous material, (n, 3), N, at :data:`FINE_RATE`."""
    first, last = SWEEP_RPM if level != "mid" else SWEEP_RPM[::-1]
    cell = MillingCell(
        structure,
        replace(CUTTER, feed_per_tooth=LEVELS[level]),
        DEPTH,
        LinearSweep(first * RPM, last * RPM, seconds),
        seconds,
        sample_rate=FINE_RATE,
        material="porous",
        sensors=dynamometer(0.0, 1e5),
        seed=seed,
    )
    return cell.samples()


class ConcealedCell:
    """A milled robot under given forces, with one effect in it, measured by six channels.

    The forces are those of a cut of the linear robot: what the effect changes in the motion does not act back on them.
    Implements :class:`acquisition.Source`.

    Parameters
    ----------
    structure
        What taps at rest would find: real modes at the tip.
    force : (n, 3), N
        Force on the tip, at :data:`FINE_RATE`.
    effect
        The effect that is hidden.
    noise
        White noise of the accelerations, as a share of each channel's standard deviation; half of it on the forces.
    seed
        Seed of the noise.
    """

    def __init__(self, structure: ModalModel, force: Real, effect: ConcealedEffect, noise: float, seed: int) -> None:
        self._structure, self._force, self._effect = structure, force, effect
        self._noise, self._seed = noise, seed
        self.n_samples = round(len(force) * RATE / FINE_RATE)
        channels = tuple(sensor.channel() for sensor in self._sensors())
        self.streams = (StreamDescription(STREAM, RATE, 0.0, channels),)
        self.title = "simulated milling of a robot, porous material, speed sweep"
        self.setup = setup_text({"test": {"kind": "simulated milling", "duration_s": len(force) / FINE_RATE}})
        self._samples: Real | None = None

    def open(self) -> None:
        """Simulate the whole recording."""
        self._samples = self.samples()

    def read(self) -> Block | None:
        """All samples in one block, then None."""
        samples, self._samples = self._samples, None
        return None if samples is None else Block(STREAM, 0, samples, len(samples) / RATE)

    def close(self) -> None:
        """Let go of the samples."""
        self._samples = None

    def samples(self) -> Real:
        """The recording (n_samples, 6): N and m/s^2."""
        clean = self.clean()
        sizes = clean.std(axis=0) * self._noise * np.array([0.5, 0.5, 0.5, 1.0, 1.0, 1.0])
        noisy = clean + sizes * np.random.default_rng(self._seed).standard_normal(clean.shape)
        return in_converter(self._effect, noisy)

    def clean(self) -> Real:
        """The recording without noise and saturation."""
        structure = concealed_structure(self._structure, self._effect)
        times = np.arange(len(self._force)) / FINE_RATE
        shaken = self._force + unmeasured_force(self._effect, times)
        acceleration = tip_motion(structure, shaken, 1 / FINE_RATE, concealed_law(self._effect))[2]
        shown = through_chain(self._effect, np.hstack([self._force, acceleration]), FINE_RATE)
        decimator = Decimator(round(FINE_RATE / RATE), shown.shape[1])
        padded = np.vstack([shown, np.tile(shown[-1:], (decimator.lookahead + 1, 1))])
        return np.asarray(decimator(padded)[: self.n_samples])

    def _sensors(self) -> tuple[Sensor, ...]:
        places = tip_accelerometers(high_pass_hz=None)
        return dynamometer() + tuple(
            replace(sensor, name=name) for sensor, name in zip(places, ("ax", "ay", "az"), strict=True)
        )
