"""Repair of recordings before causes are looked for: tones are taken out, clipping is mended."""

import numpy as np

from estimation import WindowedSpectrum

from ..inference import AcceptedCause, FaultSettings, Settings
from ..models import Fit, fit
from ..physics import CLIPPING, UNMEASURED_EXCITATION
from .clipping import Clipping, find_clipping, mended
from .tones import Tone, find_tone, stands_out, tone_beside, without_tone
from .tones_beyond import tones_beyond


def repair_faults(
    lines: list[WindowedSpectrum], base: Fit, settings: Settings
) -> tuple[list[WindowedSpectrum], Fit, list[AcceptedCause]]:
    """Take out tones and mend clipping, refitting each time.

    Parameters
    ----------
    lines
        Recordings as they were measured.
    base
        The fit without any cause.
    settings
        Thresholds of the diagnosis, those for faults among them.

    Returns
    -------
    lines, base, found
        Recordings as mended, the fit to them, and the faults as causes.
    """
    found: list[AcceptedCause] = []
    for _ in range(settings.faults.most_tones):
        tone = find_tone(base, lines, settings.faults)
        if tone is None or tone.gain < settings.evidence.least:
            break
        lines = [without_tone(base, one, tone) for one in lines]
        base = fit(lines, base.hypothesis, iterations=4)
        found.append(_tone_cause(tone, lines[0]))
    clipping = find_clipping(base, lines, settings.faults)
    if clipping is not None:
        base, lines, clipping = mended(base, lines, clipping, settings.faults)
        found.append(_clipping_cause(clipping, lines[0]))
    return lines, base, found


def with_tones_settled(
    fitted: Fit, lines: list[WindowedSpectrum], accepted: list[AcceptedCause], decay: float, settings: FaultSettings
) -> list[AcceptedCause]:
    """Accepted causes without tones that stood out only until the others were known, and with those above the band.

    Tones are told as the final fit leaves them. One whose amplitude differs much from recording to recording is not
    told: it follows the forces, as the harmonic of a joint does, or is chance in a band of noise.

    Parameters
    ----------
    fitted
        The fit with all causes.
    lines
        Recordings before tones were taken out.
    accepted
        Plain faults and causes.
    decay
        Decay rate of the slowest mode, 1/s.
    settings
        Thresholds of the tests for tones and clipping.
    """
    told: list[AcceptedCause] = []
    for cause in accepted:
        if cause.name != UNMEASURED_EXCITATION.name:
            told.append(cause)
            continue
        tone = tone_beside(fitted, lines, cause.parameters["frequency_hz"], cause.evidence)
        if stands_out(fitted, lines, tone.frequency, settings) and tone.is_steady(settings.most_varied, len(lines)):
            told.append(_tone_cause(tone, lines[0]))
    most = settings.most_tones - sum(cause.name == UNMEASURED_EXCITATION.name for cause in told)
    clipped = [cause.location["channel"] for cause in accepted if cause.name == CLIPPING.name]
    beyond = tones_beyond(fitted.hypothesis, lines, decay, most, settings, clipped)
    return told + [_tone_cause(tone, lines[0]) for tone in beyond]


def _tone_cause(tone: Tone, lines: WindowedSpectrum) -> AcceptedCause:
    names = lines.recording.channels[-len(tone.amplitudes) :]
    parameters = {"frequency_hz": tone.frequency}
    parameters |= {f"amplitude_{name}": float(value) for name, value in zip(names, tone.amplitudes, strict=True)}
    width = lines.recording.rate / len(lines.window)
    errors = {"frequency_hz": width * float(np.sqrt(6 / tone.gain)) / np.pi}
    known = [(name, float(one)) for name, one in zip(names, tone.spread, strict=True) if np.isfinite(one)]
    errors |= {f"amplitude_{name}": one for name, one in known}
    return AcceptedCause(UNMEASURED_EXCITATION.name, {"channels": list(names)}, parameters, errors, tone.gain)


def _clipping_cause(clipping: Clipping, lines: WindowedSpectrum) -> AcceptedCause:
    name = lines.recording.channels[clipping.response - lines.measured.shape[1]]
    found = clipping.saturation
    parameters, errors = {"limit": found.limit}, {"limit": found.error}
    if np.isfinite(found.sharpness):
        parameters["sharpness"], errors["sharpness"] = found.sharpness, found.sharpness_error
    return AcceptedCause(CLIPPING.name, {"channel": name}, parameters, errors, clipping.gain)
