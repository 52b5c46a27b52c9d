"""The common part of milling cell and hammer cell: from a marching simulation to blocks of a measured stream."""

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from acquisition import Block, StreamDescription
from foundation import InputError
from modal_fit import ModalModel

from .laboratory import Decimator, Sensor, SignalChain
from .simulation import ResponseMap, require_simulable

STREAM = "daq"
"""Name of the one stream a simulated cell gives."""


class March(Protocol):
    """A simulation that marches on from where it stands."""

    def advance(self, n_instants: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Modal history (n, 2 n_modes) and force (n, 3) at the next instants."""
        ...


class SampledCell:
    """Base of the simulated cells: oversampled march, response, anti-alias filter, sensors, blocks.

    Implements :class:`acquisition.Source`. Host times of the blocks are those of an ideal clock that starts at zero, so
    that a recording repeats bit by bit. See :class:`MillingCell` and :class:`HammerCell`.
    """

    def __init__(
        self,
        structure: ModalModel,
        duration: float,
        sample_rate: float,
        sensors: Sequence[Sensor],
        seed: int,
        oversampling: int,
        block_length: int,
    ) -> None:
        _require_sampling(duration, sample_rate, seed, oversampling, block_length)
        require_simulable(structure)
        self.structure = structure
        self.sensors = tuple(sensors)
        self.sample_rate = float(sample_rate)
        self.seed = int(seed)
        self.n_samples = max(round(duration * sample_rate), 1)
        self.step = 1.0 / (sample_rate * oversampling)
        self._oversampling = int(oversampling)
        self._block_length = int(block_length)
        self._map()  # refuses sensors the structure does not have, before anything is recorded
        channels = tuple(sensor.channel() for sensor in self.sensors)
        self.streams = (StreamDescription(STREAM, self.sample_rate, 0.0, channels),)
        self._pipeline: _Pipeline | None = None
        self._read = 0

    def _start(self) -> March:
        """A fresh simulation, at rest."""
        raise NotImplementedError

    def _rehearse(self) -> tuple[March, int]:
        """A fresh simulation from which the size of the signals is judged, and how many samples of it."""
        raise NotImplementedError

    def open(self) -> None:
        """Start from rest, at the first sample."""
        noise_seed = int(np.random.SeedSequence([self.seed, 1]).generate_state(1)[0])
        chain = SignalChain(self.sensors, self.sample_rate, self.noise_rms(), noise_seed)
        self._pipeline = _Pipeline(self._start(), self._map(), self._decimator(), chain)
        self._read = 0

    def read(self) -> Block | None:
        """The next block of samples, or None when the recording is complete.

        Raises
        ------
        InputError
            The cell has not been opened.
        """
        if self._pipeline is None:
            raise InputError("the simulated cell is not open; call open() first")
        wanted = min(self._block_length, self.n_samples - self._read)
        if wanted <= 0:
            return None
        samples = self._pipeline.take(wanted, self._oversampling)
        first, self._read = self._read, self._read + wanted
        return Block(STREAM, first, samples, self._read / self.sample_rate)

    def close(self) -> None:
        """Let go of the simulation; the cell may be opened again."""
        self._pipeline = None

    def samples(self) -> NDArray[np.float64]:
        """The whole recording in memory, (n_samples, n_channels), for short tests."""
        self.open()
        blocks = []
        while (block := self.read()) is not None:
            blocks.append(block.samples)
        self.close()
        return np.concatenate(blocks)

    def noise_rms(self) -> NDArray[np.float64]:
        """Standard deviation of each channel's noise, SI, from the size of its signal in a rehearsal."""
        shares = np.array([sensor.noise for sensor in self.sensors])
        if not shares.any():
            return shares
        march, n_samples = self._rehearse()
        pipeline = _Pipeline(march, self._map(), self._decimator(), None)
        size = pipeline.take(n_samples, self._oversampling).std(axis=0)
        return np.asarray(shares * size)

    def _map(self) -> ResponseMap:
        quantities = [sensor.quantity for sensor in self.sensors]
        return ResponseMap(self.structure, quantities, [sensor.degree_of_freedom for sensor in self.sensors], self.step)

    def _decimator(self) -> Decimator:
        return Decimator(self._oversampling, len(self.sensors))


class _Pipeline:
    """March, response, decimation and sensors, asked for whole numbers of output samples."""

    def __init__(self, march: March, response: ResponseMap, decimator: Decimator, chain: SignalChain | None) -> None:
        self._march, self._response, self._decimator, self._chain = march, response, decimator, chain
        self._given = 0
        self._marched = 0

    def take(self, n_samples: int, oversampling: int) -> NDArray[np.float64]:
        last_instant = (self._given + n_samples - 1) * oversampling + self._decimator.lookahead
        instants = last_instant + 2 - self._marched  # one more than asked for: the response lags one instant
        history, force = self._march.advance(instants)
        motion = self._response(history, force)
        if self._marched == 0:
            motion = motion[1:]
        self._marched += instants
        self._given += n_samples
        samples = self._decimator(motion)
        return samples if self._chain is None else self._chain(samples)


def _require_sampling(duration: float, sample_rate: float, seed: int, oversampling: int, block_length: int) -> None:
    for name, value, unit in (("duration", duration, "s"), ("sample rate", sample_rate, "Hz")):
        if not (math.isfinite(value) and value > 0):
            raise InputError(f"{name} = {value!r} {unit} must be positive and finite")
    for name, whole in (("oversampling", oversampling), ("block length", block_length)):
        if not (isinstance(whole, int) and whole >= 1):
            raise InputError(f"{name} = {whole!r} must be a whole number, 1 or more")
    if not (isinstance(seed, int) and seed >= 0):
        raise InputError(f"seed = {seed!r} must be a whole number, zero or more")
