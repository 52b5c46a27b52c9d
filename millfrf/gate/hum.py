"""Mains hum: a line at a multiple of 50 or 60 Hz that stands alone among its neighbours."""

from collections.abc import Sequence

import numpy as np
import scipy

from acquisition import Stream
from millfrf.core import Real

from .settings import GATE


def hum_warnings(stream: Stream, names: Sequence[str]) -> list[str]:
    """Return a warning about channels with mains hum.

    The power of the line at a multiple of the mains over the mean of its neighbours has the F-distribution with 2 and
    2 n degrees of freedom in noise and in a response to a force without lines. A line in all channels, as in a cut
    whose teeth pass at this frequency, is not hum.

    Parameters
    ----------
    stream
        Stream of an open recording.
    names
        Names of the channels.
    """
    length = min(stream.n_samples, GATE.hum_samples)
    first = (stream.n_samples - length) // 2
    samples = stream.read(first, first + length, names)
    if length < 8 * GATE.hum_neighbours or not np.isfinite(samples).all():
        return []
    window = scipy.signal.windows.hann(length, sym=False)[:, None]
    spectrum = np.abs(np.fft.rfft(window * (samples - samples.mean(axis=0)), axis=0)) ** 2
    found: dict[str, float] = {}
    for mains in GATE.hum:
        for multiple in range(1, GATE.hum_harmonics + 1):
            lines = _line(spectrum, mains * multiple, stream.sample_rate / length)
            if lines is None or all(lines):
                continue
            for name, hit in zip(names, lines, strict=True):
                if hit:
                    found.setdefault(name, mains * multiple)
    if not found:
        return []
    listed = ", ".join(f"{name} at {line:g} Hz" for name, line in found.items())
    return [
        f"mains hum in {listed}: a line that stands alone there; a fit may take it for a mode, and a tap for ringing: "
        "check shields and grounds, or keep the band away from it"
    ]


def _line(spectrum: Real, frequency: float, spacing: float) -> list[bool] | None:
    """Return which channels have a line at a frequency that stands alone; None where its neighbours are not known."""
    reach = max(1, round(GATE.hum_tolerance * frequency / spacing))
    centre, n = round(frequency / spacing), GATE.hum_neighbours
    low, high = centre - reach - 3 - n // 2, centre + reach + 3 + n // 2 + 1
    if low < 1 or high > len(spectrum):
        return None
    inside = spectrum[centre - reach : centre + reach + 1].max(axis=0)
    beside = np.concatenate([spectrum[low : low + n // 2], spectrum[high - n // 2 : high]]).mean(axis=0)
    candidates = (2 * reach + 1) * len(GATE.hum) * GATE.hum_harmonics * spectrum.shape[1]
    # neighbours under a Hann window are correlated: half of them count
    tail = scipy.stats.f.sf(inside / np.maximum(beside, 1e-300), 2, n)
    share = spectrum[centre - reach - 2 : centre + reach + 3].sum(axis=0) / np.maximum(spectrum.sum(axis=0), 1e-300)
    return [bool(p * candidates < GATE.p_value and s > GATE.hum_share**2) for p, s in zip(tail, share, strict=True)]
