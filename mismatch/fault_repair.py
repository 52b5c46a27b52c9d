"""Tones taken out and clipping mended before causes are looked for."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .acceptance import LEAST_EVIDENCE
from .diagnosis import AcceptedCause
from .fitting import Fit, fit
from .plain_faults import Clipping, Tone, find_clipping, find_tone, unclipped, without_tone
from .windowed_lines import WindowedLines

Real = NDArray[np.float64]


def repair_plain_faults(
    lines: list[WindowedLines], base: Fit, decay: float
) -> tuple[list[WindowedLines], Fit, list[AcceptedCause]]:
    """Take out tones and mend clipping, refitting each time."""
    found: list[AcceptedCause] = []
    for _ in range(4):
        tone = find_tone(base, lines)
        if tone is None or tone.gain < LEAST_EVIDENCE:
            break
        lines = [without_tone(one, tone) for one in lines]
        base = fit(lines, base.explanation, iterations=4)
        found.append(_tone_cause(tone, lines[0]))
    clipping = find_clipping(base, lines)
    if clipping is not None:
        originals = [one.trial.response for one in lines]
        for _ in range(4):
            lines = [
                _with_response(one, unclipped(base, one, clipping, original))
                for one, original in zip(lines, originals, strict=True)
            ]
            base = fit(lines, base.explanation, iterations=4)
            clipping = _same_clipping(base, lines, originals, clipping)
        found.append(_clipping_cause(clipping, lines[0]))
    return lines, base, found


def _same_clipping(base: Fit, lines: list[WindowedLines], originals: list[Real], clipping: Clipping) -> Clipping:
    again = find_clipping(base, [_with_response(one, old) for one, old in zip(lines, originals, strict=True)])
    return again if again is not None and again.response == clipping.response else clipping


def _with_response(lines: WindowedLines, response: Real) -> WindowedLines:
    changed = replace(lines, trial=replace(lines.trial, response=response))
    return replace(changed, measured=changed.cut(response))


def _tone_cause(tone: Tone, lines: WindowedLines) -> AcceptedCause:
    names = lines.trial.channels[-len(tone.amplitudes) :]
    parameters = {"frequency_hz": tone.frequency}
    parameters |= {f"amplitude_{name}": float(value) for name, value in zip(names, tone.amplitudes, strict=True)}
    width = lines.trial.rate / len(lines.window)
    errors = {"frequency_hz": width * float(np.sqrt(6 / tone.gain)) / np.pi}
    return AcceptedCause("unmeasured_excitation", {"channels": list(names)}, parameters, errors, tone.gain)


def _clipping_cause(clipping: Clipping, lines: WindowedLines) -> AcceptedCause:
    name = lines.trial.channels[clipping.response - lines.measured.shape[1]]
    return AcceptedCause("clipping", {"channel": name}, {"limit": clipping.limit}, {}, clipping.gain)
