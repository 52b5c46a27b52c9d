"""Short blocks of each recording at a rate a few times the driven frequencies, on which recordings are compared."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acquisition import Channel, Recording
from estimation import choose_channels, resampled, whole_ratio, widest_band
from millfrf.core import Real

from .settings import GATE


@dataclass(frozen=True)
class RecordBlocks:
    """Blocks of one recording, spread over its duration.

    Parameters
    ----------
    name
        Name of the recording.
    rate : Hz
        Sample rate of the blocks.
    times : (n_blocks,), s
        Middle of each block.
    force : n_blocks of (n_samples, n_excitations)
        Forces without their mean.
    response : n_blocks of (n_samples, n_responses)
        Responses without their mean.
    means : (n_blocks, n_excitations)
        Means of the forces in the blocks.
    excitations, responses
        Channels along the columns.
    setup
        Set-up that the recording states, TOML text.
    rate_recorded : Hz
        Sample rate of the recording.
    """

    name: str
    rate: float
    times: Real
    force: tuple[Real, ...]
    response: tuple[Real, ...]
    means: Real
    excitations: tuple[Channel, ...]
    responses: tuple[Channel, ...]
    setup: str
    rate_recorded: float


def blocks_of_recordings(
    recordings: Sequence[Recording],
    stream: str | None = None,
    excitations: Sequence[str] = (),
    responses: Sequence[str] = (),
) -> tuple[RecordBlocks, ...]:
    """Read blocks of recordings, and resample them to ten times the frequency that bounds nine tenths of the force.

    The parameters are those of :func:`check_consistency`. Recordings of different sample rates are not compared: the
    result is then empty, as it is for recordings without force.
    """
    sources = [recording.stream(stream) for recording in recordings]
    chosen = [choose_channels(source, excitations or None, responses or None) for source in sources]
    rates = {source.sample_rate for source in sources}
    layouts = {tuple(channel.name for side in sides for channel in side) for sides in chosen}
    if len(rates) > 1 or len(layouts) > 1:
        return ()
    rate = rates.pop()
    exciting, responding = chosen[0]
    names = [channel.name for channel in (*exciting, *responding)]
    read = []
    for source in sources:
        length = min(source.n_samples // GATE.blocks, round(GATE.block_seconds * rate), GATE.block_samples)
        starts = np.linspace(0, source.n_samples - length, GATE.blocks).astype(int)
        read.append((starts + length / 2, [source.read(first, first + length, names) for first in starts.tolist()]))
    driven = _driven([block[:, : len(exciting)] for _, blocks in read for block in blocks], rate)
    if driven is None or not all(np.isfinite(block).all() for _, blocks in read for block in blocks):
        return ()
    ratio = whole_ratio(rate, min(4 * driven, widest_band(rate)))
    unknowns = GATE.onset_past + (5 * GATE.coarse_step + GATE.onset_lags) * len(exciting)
    results = []
    for recording, (middles, blocks), (forces, motions) in zip(recordings, read, chosen, strict=True):
        reduced = [resampled(block - block.mean(axis=0), rate, ratio)[0] for block in blocks]
        if len(reduced[0]) < 2 * unknowns:
            return ()
        reduced = [block - block.mean(axis=0) for block in reduced]
        n = len(forces)
        results.append(
            RecordBlocks(
                recording.path.name,
                rate * float(ratio),
                middles / rate,
                tuple(block[:, :n] for block in reduced),
                tuple(block[:, n:] for block in reduced),
                np.array([block[:, :n].mean(axis=0) for block in blocks]),
                forces,
                motions,
                recording.setup,
                rate,
            )
        )
    return tuple(results)


def _driven(forces: Sequence[Real], rate: float) -> float | None:
    """Return the frequency (Hz) below which nine tenths of the forces' power lie."""
    length = min(len(force) for force in forces)
    if length < GATE.block_rows_min:
        return None
    window = np.hanning(length)[:, None]
    lines = [np.fft.rfft(window * (force[:length] - force[:length].mean(axis=0)), axis=0) for force in forces]
    power = np.asarray(sum(np.sum(np.abs(line) ** 2, axis=1) for line in lines))
    if not 0 < power.sum() < np.inf:
        return None
    bound = int(np.searchsorted(np.cumsum(power), 0.9 * power.sum()))
    return float(np.fft.rfftfreq(length, 1 / rate)[max(bound, 1)])
