"""Faults of recordings, which are corrected or added to predictions: wiring, clocks, rounding, clipping, tones."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import scipy

from estimation import BandRecording
from millfrf.core import Real

from ..joints.joint_law import saturated
from .protocol import Parameter


class RecordingFault:
    """A fault of the recordings that is named, and corrected where it can be, before the search for causes."""

    confusable_with: tuple[str, ...] = ()

    def __init__(self, name: str, equation: str, source: str, *parameters: Parameter) -> None:
        self.name, self.equation, self.source, self.parameters = name, equation, source, parameters


_WIRING = "y_measured = P y, P a signed permutation", "Ewins, Modal Testing, 2nd ed., chapter 3"
SWAPPED_CHANNELS = RecordingFault("swapped_channels", *_WIRING)
REVERSED_CHANNEL = RecordingFault("reversed_channel", *_WIRING)
QUANTISATION = RecordingFault(
    "quantisation",
    "y_measured = q round(y / q)",
    "Widrow & Kollar, Quantization Noise, 2008: noise of variance q^2 / 12",
    Parameter("step", "unit of the channel", 1e-3, 0.0),
)


class ClockSkew:
    """Forces and responses come from two devices whose clocks run at different rates."""

    order = 2
    name = "clock_skew"
    equation = "y_measured(t) = y(t - e t)"
    source = "Sivrikaya & Yener 2004, IEEE Network 18 (clock synchronisation in sensor networks)"
    parameters: tuple[Parameter, ...] = (Parameter("rate_error", "", 1e-6, -0.1, 0.1),)
    confusable_with = ("channel_delay", "pose_drift")

    def shown(self, response: Real, recording: BandRecording, start: int, term: Mapping[str, Any]) -> Real:
        """Return a predicted response (n_samples, n_responses) with the clock of the responses."""
        del start
        return delayed(response, recording, float(term["parameters"]["rate_error"]))


CLOCK_SKEW = ClockSkew()


def delayed(response: Real, recording: BandRecording, rate: float) -> Real:
    """Return a response (n_samples, n_responses) delayed by ``rate`` times the time since the recording began."""
    time = recording.start + np.arange(len(response)) / recording.rate
    spline = scipy.interpolate.make_interp_spline(time, response, k=5)
    return np.asarray(spline(np.clip(time * (1 - rate), time[0], time[-1])))


class Clipping:
    """An amplifier or a converter beyond its range, with a sharp or a rounded limit."""

    order = 1
    name = "clipping"
    equation = "y_shown = y / (1 + |y / l|^n)^(1/n), sharp for n = infinity"
    source = "Godsill & Rayner, Digital Audio Restoration, 1998, section 4.1"
    parameters: tuple[Parameter, ...] = (Parameter("limit", "unit of the channel", 0.01, 0.0),)
    confusable_with = ("stiffness_hardening",)

    def shown(self, response: Real, recording: BandRecording, start: int, term: Mapping[str, Any]) -> Real:
        """Return a predicted response (n_samples, n_responses) with the limit of the clipped channel."""
        response = response.copy()
        column = recording.channels.index(term["location"]["channel"]) - recording.force.shape[1]
        limit, sharpness = (float(term["parameters"].get(name, np.inf)) for name in ("limit", "sharpness"))
        response[:, column] = saturated(response[:, column], limit, sharpness)
        return response


CLIPPING = Clipping()


class UnmeasuredExcitation:
    """The responses hold a sinusoid that no measured force explains."""

    order = 0
    name = "unmeasured_excitation"
    equation = "y_shown = y + A cos(2 pi f t + phi)"
    source = "Bendat & Piersol, Random Data, 4th ed., section 6.1.4 (extraneous noise)"
    parameters: tuple[Parameter, ...] = (Parameter("frequency_hz", "Hz", 0.01, 0.0),)
    confusable_with = ("missing_mode",)

    def shown(self, response: Real, recording: BandRecording, start: int, term: Mapping[str, Any]) -> Real:
        """Return a predicted response (n_samples, n_responses) with the tone.

        The phase of a steady tone differs between recordings: amplitude and phase are taken from ``recording``.
        """
        time = np.arange(len(response)) / recording.rate
        residual = recording.response[: len(response)] - response
        return response + _tone_in(residual, time, float(term["parameters"]["frequency_hz"]), start)


def _tone_in(residual: Real, time: Real, frequency: float, start: int) -> Real:
    """Return the strongest sinusoid near a frequency (Hz) in a residual after the run-in, (n_samples, n_responses)."""
    steady, times = residual[start:], time[start:]
    padded = 8 * len(steady)
    spectrum = np.abs(scipy.fft.rfft(steady * np.hanning(len(steady))[:, None], n=padded, axis=0)) ** 2
    axis = np.arange(padded // 2 + 1) / padded / (times[1] - times[0])
    near = np.abs(axis - frequency) < 2.0 / (times[-1] - times[0])
    exact = float(axis[near][np.argmax(spectrum[near].sum(axis=1))]) if near.any() else frequency
    waves = np.column_stack([np.cos(2 * np.pi * exact * time), np.sin(2 * np.pi * exact * time)])
    return np.asarray(waves @ np.linalg.lstsq(waves[start:], steady, rcond=None)[0])


UNMEASURED_EXCITATION = UnmeasuredExcitation()
