"""Effects from around the joints: a further mode, forces that nobody measures, an off nominal model, nothing."""

import numpy as np

from ..excitation import RATE
from .change import Change, Effect, Scene, Signals


def missing_mode(scene: Scene, family: str, dial: float) -> Change:
    """The structure has a further mode, 9-70 Hz, whose participation grows with ``dial``; ``close``: within 8 % of one
    that the nominal model has."""
    rng = scene.rng()
    known = np.abs(scene.structure.poles) / (2 * np.pi)
    frequency = float(np.exp(rng.uniform(np.log(9), np.log(70))))
    if family == "close":
        frequency = float(np.clip(rng.choice(known) * (1 + rng.choice([-1, 1]) * rng.uniform(0.04, 0.08)), 6, 78))
    else:
        while np.abs(np.log(known / frequency)).min() < 0.1:
            frequency = float(np.exp(rng.uniform(np.log(9), np.log(70))))
    damping = float(np.exp(rng.uniform(np.log(0.01), np.log(0.06))))
    shape = rng.standard_normal(3)
    shape *= np.sqrt(dial) * 0.1 / np.linalg.norm(shape)
    grown = scene.structure.with_mode(frequency, damping, shape)
    return Change(structure=grown, parameters={"fn": frequency, "zeta": damping})


def tone(scene: Scene, family: str, dial: float) -> Change:
    """A steady tone from elsewhere shakes the tip; ``with_harmonic``: with a second one at twice the frequency."""
    rng = scene.rng()
    frequency = float(rng.uniform(8, 60))
    push = rng.standard_normal(3)
    push *= dial * scene.force / np.linalg.norm(push)
    overtone = 0.5 if family == "with_harmonic" else 0.0

    def shake(n: int, draw: np.random.Generator) -> Signals:
        phase = 2 * np.pi * frequency * np.arange(n) / RATE + draw.uniform(0, 2 * np.pi)
        wave = (np.sin(phase) + overtone * np.sin(2 * phase)) * _eased(n)
        return wave[:, None] * push

    return Change(shake=shake, parameters={"hz": frequency})


def impacts(scene: Scene, family: str, dial: float) -> Change:
    """Foreign: random half-sine blows of 8 ms at the tip, two a second."""
    push = scene.rng().standard_normal(3)
    push *= 8 * dial * scene.force / np.linalg.norm(push)

    def shake(n: int, draw: np.random.Generator) -> Signals:
        train = np.zeros(n)
        for start in draw.integers(RATE, n - RATE, round(2 * n / RATE)):
            train[start : start + 5] += draw.uniform(0.5, 1.5) * np.sin(np.pi * (np.arange(5) + 0.5) / 5)
        return np.asarray(train[:, None] * push)

    return Change(shake=shake)


def rumble(scene: Scene, family: str, dial: float) -> Change:
    """Foreign: unmeasured random force between 5 and 40 Hz along a fixed direction (a neighbour's machine)."""
    push = scene.rng().standard_normal(3)
    push *= dial * scene.force / np.linalg.norm(push)

    def shake(n: int, draw: np.random.Generator) -> Signals:
        spectrum = np.fft.rfft(draw.standard_normal(n))
        frequencies = np.fft.rfftfreq(n, 1 / RATE)
        spectrum[(frequencies < 5) | (frequencies > 40)] = 0
        wave = np.fft.irfft(spectrum, n)
        return np.asarray((wave / wave.std() * _eased(n))[:, None] * push)

    return Change(shake=shake)


def _eased(n: int) -> Signals:
    rise = np.clip(np.arange(n) / RATE, 0, 1) * np.clip((n - 1 - np.arange(n)) / (0.5 * RATE), 0, 1)
    return np.asarray(np.sin(np.pi / 2 * rise) ** 2)


def nothing(scene: Scene, family: str, dial: float) -> Change:
    """No change: the case is in the nominal model, or there is none."""
    return Change()


EFFECTS = (
    Effect("missing_mode", ("apart", "close"), missing_mode, 0.05, 20),
    Effect("unmeasured_excitation", ("tone", "with_harmonic"), tone, 0.02, 50),
)
NOT_SOUGHT = (
    Effect("none", ("none",), nothing),
    Effect("modal_parameters", ("all", "frequency", "damping", "shape"), nothing),
)
FOREIGN = (
    Effect("impacts", ("half_sine",), impacts, 0.1, 100),
    Effect("rumble", ("band",), rumble, 0.02, 50),
)
