"""Effects on the measuring chain: before the converter, and in it."""

import numpy as np
from numpy.typing import NDArray
from scipy.signal import bilinear, lfilter
from scipy.spatial.transform import Rotation

from .concealed_effect import CHANNELS, ConcealedEffect

Real = NDArray[np.float64]


def through_chain(effect: ConcealedEffect, signals: Real, rate: float) -> Real:
    """Analogue faults on ``fx fy fz ax ay az``, (n, 6), sampled finely at ``rate`` (Hz)."""
    values, shown = effect.parameters, signals.copy()
    if effect.name == "channel_delay":
        late = np.arange(len(signals)) - values["delay_s"] * rate
        for column in (3, 4, 5):
            shown[:, column] = np.interp(late, np.arange(len(signals)), signals[:, column], left=0.0)
    elif effect.name == "ac_coupling":
        corner = 2 * np.pi * values["corner_hz"]
        shown[:, 3:] = lfilter(*bilinear([1.0, 0.0], [1.0, corner], rate), signals[:, 3:], axis=0)
    elif effect.name == "dynamometer_dynamics":
        natural, zeta = 2 * np.pi * values["frequency_hz"], values["damping_ratio"]
        resonance = bilinear([natural**2], [1.0, 2 * zeta * natural, natural**2], rate)
        shown[:, :3] = lfilter(*resonance, signals[:, :3], axis=0)
    elif effect.name == "axis_misalignment":
        shown[:, :3] = Rotation.from_rotvec(values["rotation_deg"], degrees=True).apply(signals[:, :3])
    elif effect.name == "gain_error":
        shown[:, CHANNELS.index(values["channel"])] *= values["gain"]
    return shown


def in_converter(effect: ConcealedEffect, samples: Real) -> Real:
    """Saturation of a channel, noise included."""
    shown = samples.copy()
    if effect.name == "clipping":
        column, limit = CHANNELS.index(effect.parameters["channel"]), effect.parameters["limit_m_per_s2"]
        shown[:, column] = np.clip(shown[:, column], -limit, limit)
    return shown
