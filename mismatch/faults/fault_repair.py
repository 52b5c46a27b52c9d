"""Tones taken out and clipping mended before causes are looked for."""

import numpy as np

from estimation import WindowedSpectrum

from ..adapters.structure.acceptance import LEAST_EVIDENCE
from ..inference.diagnosis import AcceptedCause
from ..models.fitting import Fit, fit
from .clipping import Clipping, find_clipping, mended
from .tones import Tone, find_tone, stands_out, without_tone
from .tones_beyond import tones_beyond

MOST_TONES = 4


def repair_plain_faults(
    lines: list[WindowedSpectrum], base: Fit
) -> tuple[list[WindowedSpectrum], Fit, list[AcceptedCause]]:
    """Take out tones and mend clipping, refitting each time."""
    found: list[AcceptedCause] = []
    for _ in range(MOST_TONES):
        tone = find_tone(base, lines)
        if tone is None or tone.gain < LEAST_EVIDENCE:
            break
        lines = [without_tone(base, one, tone) for one in lines]
        base = fit(lines, base.explanation, iterations=4)
        found.append(_tone_cause(tone, lines[0]))
    clipping = find_clipping(base, lines)
    if clipping is not None:
        base, lines, clipping = mended(base, lines, clipping)
        found.append(_clipping_cause(clipping, lines[0]))
    return lines, base, found


def with_tones_settled(
    fitted: Fit, lines: list[WindowedSpectrum], accepted: list[AcceptedCause], decay: float
) -> list[AcceptedCause]:
    """Accepted causes without tones that stood out only until the others were known, and with those above the band.

    Parameters
    ----------
    fitted
        With all causes.
    lines
        Recordings before tones were taken out.
    accepted
        Plain faults and causes.
    decay
        Of the slowest mode, 1/s.
    """
    tones = [cause for cause in accepted if cause.name == "unmeasured_excitation"]
    gone = [one for one in tones if not stands_out(fitted, lines, one.parameters["frequency_hz"])]
    beyond = tones_beyond(fitted.explanation, lines, decay, MOST_TONES - len(tones) + len(gone))
    return [cause for cause in accepted if cause not in gone] + [_tone_cause(tone, lines[0]) for tone in beyond]


def _tone_cause(tone: Tone, lines: WindowedSpectrum) -> AcceptedCause:
    names = lines.recording.channels[-len(tone.amplitudes) :]
    parameters = {"frequency_hz": tone.frequency}
    parameters |= {f"amplitude_{name}": float(value) for name, value in zip(names, tone.amplitudes, strict=True)}
    width = lines.recording.rate / len(lines.window)
    errors = {"frequency_hz": width * float(np.sqrt(6 / tone.gain)) / np.pi}
    known = [(name, float(one)) for name, one in zip(names, tone.spread, strict=True) if np.isfinite(one)]
    errors |= {f"amplitude_{name}": one for name, one in known}
    return AcceptedCause("unmeasured_excitation", {"channels": list(names)}, parameters, errors, tone.gain)


def _clipping_cause(clipping: Clipping, lines: WindowedSpectrum) -> AcceptedCause:
    name = lines.recording.channels[clipping.response - lines.measured.shape[1]]
    found = clipping.saturation
    parameters, errors = {"limit": found.limit}, {"limit": found.error}
    if np.isfinite(found.sharpness):
        parameters["sharpness"], errors["sharpness"] = found.sharpness, found.sharpness_error
    return AcceptedCause("clipping", {"channel": name}, parameters, errors, clipping.gain)
