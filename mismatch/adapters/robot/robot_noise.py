"""Noise of recordings, from what a robot's freely fitted modes leave of them."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

from ...noise.noise_model import NoiseModel, fit_noise, whitening
from .posed_recording import PosedRecording
from .robot_fit import RobotFit
from .robot_receptance import RobotModes, predicted_lines
from .robot_setting import Setting

Complex = NDArray[np.complex128]


def noise_of(setting: Setting, fitted: RobotFit) -> list[NoiseModel]:
    """Noise of each recording from what a fit leaves over (:func:`mismatch.noise.noise_model.fit_noise`).

    Raises
    ------
    InputError
        A channel that is zero in the band.
    """
    noises = []
    for recording, here in zip(setting.recordings, fitted.modes, strict=True):
        lines = recording.lines
        rest = lines.measured - predicted_lines(here, lines)
        levels = (
            np.sqrt(np.mean(np.abs(lines.measured) ** 2, axis=0)),
            np.sqrt(np.mean(np.abs(lines.force_here) ** 2, axis=0)),
        )
        if not (levels[0].all() and levels[1].all()):
            raise InputError(f"{recording.name}: a channel is zero in the band; leave it out")
        noises.append(fit_noise(lines.frequencies, rest, _through(here, recording), levels))
    return noises


def whiteners_of(setting: Setting, fitted: RobotFit, noises: Sequence[NoiseModel]) -> list[Complex]:
    """W of each recording: covariance of the noise at the fit's receptances, inverted."""
    return [
        whitening(noise.covariance(recording.lines.frequencies, _through(here, recording)))
        for recording, here, noise in zip(setting.recordings, fitted.modes, noises, strict=True)
    ]


def _through(modes: RobotModes, recording: PosedRecording) -> Complex:
    frequencies = recording.lines.frequencies
    return np.asarray(modes.receptance(frequencies) * recording.lines.kinematic[:, :, None])
